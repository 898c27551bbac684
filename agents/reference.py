"""``python agents/reference.py`` is ``smo-gym reference``."""

import sys

from smo_gym.cli.reference import main

if __name__ == "__main__":
    sys.exit(main())
