"""``python agents/tune.py`` is ``smo-gym tune``."""

import sys

from smo_gym.cli.tune import main

if __name__ == "__main__":
    sys.exit(main())
