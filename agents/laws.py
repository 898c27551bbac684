"""``python agents/laws.py`` is ``smo-gym laws``."""

import sys

from smo_gym.cli.laws import main

if __name__ == "__main__":
    sys.exit(main())
