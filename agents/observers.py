"""``python agents/observers.py`` is ``smo-gym observers``."""

import sys

from smo_gym.cli.observers import main

if __name__ == "__main__":
    sys.exit(main())
