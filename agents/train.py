"""``python agents/train.py`` is ``smo-gym train``."""

import sys

from smo_gym.cli.train import main

if __name__ == "__main__":
    sys.exit(main())
