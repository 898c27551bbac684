"""``python agents/upright.py`` is ``smo-gym upright``."""

import sys

from smo_gym.cli.upright import main

if __name__ == "__main__":
    sys.exit(main())
