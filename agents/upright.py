"""How often the truly inverted plant falls: by observer, start and uncertainty.

python agents/upright.py --runs 1000
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from scipy import stats
from tabulate import tabulate
from tqdm import tqdm

from smo_gym.evaluation import scenario, study

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "upright.yaml"
ARMS = {
    "without": "printed gains, without compensation",
    "with": "with compensation",
    "theorem": "designed gains",
    "oracle": "true state",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table of falls; 0 when all went well, 2 for a bad argument or setting."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--config", type=Path, default=CONFIG, metavar="FILE", help="a scenario of your own")
    parser.add_argument("--runs", type=int, default=1000, metavar="N", help="random plants a cell (default 1000)")
    parser.add_argument("--seed", type=int, default=0, help="of the random plants (default 0)")
    args = parser.parse_args(arguments)
    try:
        if args.runs < 1 or args.seed < 0:
            raise ValueError(f"--runs {args.runs} must be at least 1 and --seed {args.seed} at least 0")
        one = scenario.load(args.config)
        groups = [g for g in study.groups([one], list(one.controllers), list(ARMS), args.runs) if g.uncertainty > 0.0]
    except ValueError as error:
        print(f"upright.py: error: {error}", file=sys.stderr)
        return 2
    total = study.simulated_seconds(groups)
    with tqdm(total=total, unit="s", unit_scale=True, desc="simulated", leave=False, disable=None) as bar:
        outcomes = study.measure(groups, args.seed, bar.update)
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for outcome in outcomes:
        group = outcome.group
        falls, runs = int(outcome.failed.sum()), len(outcome.failed)
        interval = stats.binomtest(falls, runs).proportion_ci(method="wilson")
        text = f"{100 * falls / runs:.1f} [{100 * interval.low:.1f}, {100 * interval.high:.1f}]"
        cells.setdefault((group.case, f"{100 * group.uncertainty:g} %"), {})[group.arm] = text
    rows = [(*place, *(by_arm[arm] for arm in ARMS)) for place, by_arm in cells.items()]
    rows.sort(key=lambda row: row[0])  # starts, each with its levels in order
    print(f"Falls in percent of {args.runs} random plants, with 95 % Wilson intervals:\n")
    print(tabulate(rows, ("start, rad", "uncertainty", *ARMS.values()), disable_numparse=True))
    return 0


if __name__ == "__main__":
    sys.exit(main())
