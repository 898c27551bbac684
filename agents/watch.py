"""``python agents/watch.py`` is ``smo-gym watch``."""

import sys

from smo_gym.cli.watch import main

if __name__ == "__main__":
    sys.exit(main())
