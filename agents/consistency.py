"""Recompute every average, RMS and reduction of the article from its own cells, by both definitions.

python agents/consistency.py          # what does not follow
python agents/consistency.py --all    # everything
"""

from __future__ import annotations

if __name__ == "__main__":  # before the imports below, which take seconds
    from _starting import begin

    begin()

import math
import sys
from collections.abc import Sequence

from tabulate import tabulate

from smo_gym.article.consistency import checks
from smo_gym.cli.arguments import Parser
from smo_gym.cli.entry import command

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


@command("consistency.py")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison."""
    parser = Parser(__doc__)
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
