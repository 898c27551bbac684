"""``python agents/settle.py`` is ``smo-gym settle``."""

import sys

from smo_gym.cli.settle import main

if __name__ == "__main__":
    sys.exit(main())
