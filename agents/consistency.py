"""Recompute every average, RMS and reduction of the article from its own cells, by both definitions.

python agents/consistency.py          # what does not follow
python agents/consistency.py --all    # everything
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence

from tabulate import tabulate

from smo_gym.article.consistency import checks

HEADER = (
    "table",
    "controller",
    "row",
    "quantity",
    "",
    "compensation",
    "printed",
    "from cells",
    "mean of reductions",
    "agrees",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--all", action="store_true", help="show what agrees too")
    args = parser.parse_args(arguments)
    found = checks()
    rows = [
        (
            *(one.table, one.controller, one.row, one.quantity, one.state, one.compensation),
            f"{one.printed:.6g}",
            f"{one.recomputed:.6g}",
            "" if math.isnan(one.alternative) else f"{one.alternative:.4g}",
            one.agrees,
        )
        for one in found
        if args.all or one.agrees != "yes"
    ]
    print(tabulate(rows, HEADER, disable_numparse=True))
    agreeing = sum(one.agrees == "yes" for one in found)
    print(f"\n{agreeing} of {len(found)} printed numbers follow from the printed cells.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
