"""``python agents/animate.py`` is ``smo-gym animate``."""

import sys

from smo_gym.cli.animate import main

if __name__ == "__main__":
    sys.exit(main())
