"""Recompute every average, RMS and reduction of the article from its own cells, by both definitions.

smo-gym consistency          # what does not follow
smo-gym consistency --all    # everything
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tabulate import tabulate

from ..article.consistency import checks
from .arguments import Parser
from .entry import command

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


@command("consistency")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison."""
    parser = Parser("consistency", __doc__)
    parser.add_argument("--all", action="store_true", help="show what agrees too")
    args = parser.parse_args(arguments)
    found = checks()
    rows = [
        (
            *(check.table, check.controller, check.row, check.quantity, check.state, check.compensation),
            f"{check.printed:.6g}",
            f"{check.recomputed:.6g}",
            "" if math.isnan(check.alternative) else f"{check.alternative:.4g}",
            check.agrees,
        )
        for check in found
        if args.all or check.agrees != "yes"
    ]
    print(tabulate(rows, HEADER, disable_numparse=True))
    agreeing = sum(check.agrees == "yes" for check in found)
    print(f"\n{agreeing} of {len(found)} printed numbers follow from the printed cells.")
    return 0
