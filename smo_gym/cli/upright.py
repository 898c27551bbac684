"""How often the truly inverted plant falls: by observer, start and uncertainty.

smo-gym upright --runs 1000
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from scipy import stats
from tabulate import tabulate

from .. import files
from ..article import WITHOUT
from ..evaluation import configs, scenario, study
from ..evaluation.arms import ARMS, THEOREM
from ..evaluation.formats import as_csv, markdown
from . import computing, narrow
from .arguments import Parser
from .entry import command
from .progress import simulated

RESULTS = ("falls.csv", "falls.md")
TITLES = {arm.name: arm.title for arm in ARMS.values()} | {
    WITHOUT: "printed gains, without compensation",
    THEOREM: "designed gains",
}


@command("upright")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table of falls; 0 when all went well, 2 for a bad argument or setting."""
    parser = Parser("upright", __doc__)
    config = configs.path("upright")
    parser.add_argument("--config", type=Path, default=config, metavar="FILE", help="a scenario of your own")
    parser.runs(1000, "random plants a cell")
    parser.seed("the random plants")
    parser.out(None, "folder for falls.csv and falls.md")
    computing.add(parser)
    args = parser.parse_args(arguments)
    place = scenario.load(args.config)
    groups = [g for g in study.groups([place], list(place.controllers), list(TITLES), args.runs) if g.uncertainty > 0.0]
    claimed = contextlib.nullcontext() if args.out is None else files.claimed(args.out, RESULTS)
    with claimed as out, computing.computing(args, out) as measure:
        with simulated(groups) as bar:
            outcomes = measure(groups, args.seed, bar.update)
        told = f"Falls in percent of {args.runs} random plants, with 95 % Wilson intervals:\n\n"
        try:
            if out is not None:
                falls = told + table(outcomes, "github") + f"\n\nSeed {args.seed}, {markdown(str(args.config))}\n"
                files.write_set(out, dict(zip(RESULTS, (data(outcomes), falls), strict=True)))
        finally:  # what cannot be written can be read at least
            header, rows = cells(outcomes)
            print(f"{told}{narrow.table(header, rows)}\n\n{narrow.paragraph(in_words(outcomes))}")
        if out is not None:
            print(f"falls.csv and falls.md are in {out}")
    return 0


def table(outcomes: Sequence[study.Outcome], form: str) -> str:
    """Percentages of runs that fell, by start, level and arm, in a format of tabulate."""
    header, rows = cells(outcomes)
    return tabulate(rows, header, tablefmt=form, disable_numparse=True)


def cells(outcomes: Sequence[study.Outcome]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the table."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for group, falls, runs, low, high in counts(outcomes):
        text = f"{100 * falls / runs:.1f} [{100 * low:.1f}, {100 * high:.1f}]"
        found.setdefault((group.case, f"{100 * group.uncertainty:g} %"), {})[group.arm] = text
    rows = [(*place, *(by_arm[arm] for arm in TITLES)) for place, by_arm in found.items()]
    rows.sort(key=lambda row: row[0])  # starts, each with its levels in order
    return ("start, rad", "uncertainty", *TITLES.values()), rows


def in_words(outcomes: Sequence[study.Outcome]) -> str:
    """How many fell over all starts, where the plants differ most."""
    most = max(outcome.group.uncertainty for outcome in outcomes)
    shares = {}
    for arm, title in TITLES.items():
        fell = [o.failed for o in outcomes if o.group.arm == arm and o.group.uncertainty == most]
        shares[title] = f"{100 * sum(each.sum() for each in fell) / sum(each.size for each in fell):.1f} %"
    told = "; ".join(f"{title}, {share}" for title, share in shares.items())
    return f"At {100 * most:g} % of uncertainty, over all starts, this many fall: {told}."


def data(outcomes: Sequence[study.Outcome]) -> str:
    """Fractions of runs that fell, one line a start, level and arm, as CSV."""
    lines = [
        (group.case, group.uncertainty, group.arm, falls, runs, falls / runs, low, high)
        for group, falls, runs, low, high in counts(outcomes)
    ]
    return as_csv(("start", "uncertainty", "arm", "falls", "runs", "fraction", "ci_low", "ci_high"), lines)


def counts(outcomes: Sequence[study.Outcome]) -> list[tuple[study.Group, int, int, float, float]]:
    """Falls and runs of every group, and the Wilson interval of their ratio."""
    found = []
    for outcome in outcomes:
        falls, runs = int(outcome.failed.sum()), len(outcome.failed)
        interval = stats.binomtest(falls, runs).proportion_ci(method="wilson")
        found.append((outcome.group, falls, runs, float(interval.low), float(interval.high)))
    return found
