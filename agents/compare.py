"""``python agents/compare.py`` is ``smo-gym compare``."""

import sys

from smo_gym.cli.compare import main

if __name__ == "__main__":
    sys.exit(main())
