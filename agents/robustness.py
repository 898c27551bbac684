"""``python agents/robustness.py`` is ``smo-gym robustness``."""

import sys

from smo_gym.cli.robustness import main

if __name__ == "__main__":
    sys.exit(main())
