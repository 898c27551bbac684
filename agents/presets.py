"""``python agents/presets.py`` is ``smo-gym presets``."""

import sys

from smo_gym.cli.presets import main

if __name__ == "__main__":
    sys.exit(main())
