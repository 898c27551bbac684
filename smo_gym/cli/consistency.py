"""Recompute every average, RMS and reduction of the article from its own cells, by both definitions.

smo-gym consistency          # what does not follow
smo-gym consistency --all    # everything
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from ..article.consistency import checks
from . import narrow
from .arguments import Parser
from .entry import command

TITLE = "The article's numbers beside what its own cells give: RMS in m and rad, reductions in percent."
HEADER = ("table, controller, row", "quantity", "printed", "from cells", "mean of reductions", "agrees")


@command("consistency")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the comparison."""
    parser = Parser("consistency", __doc__)
    parser.add_argument("--all", action="store_true", help="show what agrees too")
    args = parser.parse_args(arguments)
    found = checks()
    rows = [
        (
            ", ".join(filter(None, (check.table, check.controller, check.row))),
            ", ".join(filter(None, (check.quantity, check.state, check.compensation))),
            f"{check.printed:.6g}",
            f"{check.recomputed:.6g}",
            "" if math.isnan(check.alternative) else f"{check.alternative:.4g}",
            check.agrees,
        )
        for check in found
        if args.all or check.agrees != "yes"
    ]
    print(f"{TITLE}\n\n{narrow.table(HEADER, rows)}\n")
    counts = Counter(check.agrees for check in found)
    others = "".join(f", {count} {how}" for how, count in counts.items() if how not in ("yes", "no"))
    follow = f"{counts['yes']} of {len(found)} printed numbers follow from the printed cells"
    told = f"{follow}{others}, {counts['no']} by neither."
    print(narrow.paragraph(told))
    return 0
