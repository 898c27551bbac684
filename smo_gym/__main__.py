"""``python -m smo_gym`` is ``smo-gym``."""

import sys

from .cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
