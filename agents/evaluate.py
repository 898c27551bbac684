"""``python agents/evaluate.py`` is ``smo-gym evaluate``."""

import sys

from smo_gym.cli.evaluate import main

if __name__ == "__main__":
    sys.exit(main())
