"""``python agents/theorem.py`` is ``smo-gym theorem``."""

import sys

from smo_gym.cli.theorem import main

if __name__ == "__main__":
    sys.exit(main())
