"""``python agents/consistency.py`` is ``smo-gym consistency``."""

import sys

from smo_gym.cli.consistency import main

if __name__ == "__main__":
    sys.exit(main())
