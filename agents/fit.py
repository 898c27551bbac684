"""``python agents/fit.py`` is ``smo-gym fit``."""

import sys

from smo_gym.cli.fit import main

if __name__ == "__main__":
    sys.exit(main())
