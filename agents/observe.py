"""``python agents/observe.py`` is ``smo-gym observe``."""

import sys

from smo_gym.cli.observe import main

if __name__ == "__main__":
    sys.exit(main())
