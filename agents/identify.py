"""``python agents/identify.py`` is ``smo-gym identify``."""

import sys

from smo_gym.cli.identify import main

if __name__ == "__main__":
    sys.exit(main())
