"""Recover what the article does not print from what it does: LQR weights and observer slopes from Table 5's LQR cells.

    python agents/identify.py --out identification

CMA-ES from random starts; the gain is the LQR solution for Q = diag(q), R = 1. The state is saved after every
generation: run the same command again to go on after an interruption. Writes report.md and report.json.
Needs the extra "reference" (cma).
"""

from __future__ import annotations

import argparse
import json
import math
import pickle
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate
from tqdm import tqdm

from smo_gym import LQR
from smo_gym.evaluation import files, scenario
from smo_gym.evaluation.identification import ALTERNATIVES, NAMES, Hypothesis, Search, Table5, profile

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "initial-conditions.yaml"
FACTORS = (0.8, 0.9, 1.1, 1.25)


def main(arguments: Sequence[str] | None = None) -> int:
    """Search, or go on searching, and report; 0 when all went well, 2 for a bad argument, 130 when interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    add = parser.add_argument
    add("--restarts", type=int, default=2, metavar="N", help="random starts (default 2)")
    add("--generations", type=int, default=80, metavar="N", help="of each search (default 80)")
    add("--refit", type=int, default=10, metavar="N", help="generations for each rejected hypothesis (default 10)")
    add("--seed", type=int, default=0, help="of the first start (default 0)")
    add("--out", type=Path, default=Path("identification"), metavar="DIR", help="default %(default)s")
    args = parser.parse_args(arguments)
    plan = {name: getattr(args, name) for name in ("restarts", "generations", "refit", "seed")}
    try:
        if min(args.restarts, args.generations) < 1 or min(args.refit, args.seed) < 0:
            raise ValueError("--restarts and --generations must be at least 1, --refit and --seed at least 0")
        one = scenario.load(CONFIG)
        out = files.prepare(args.out)
        problem = Table5(dict(one.initial_states.value), one.control_period.value)
        searches = resume(out / "state.pkl", plan) or [
            *(Search(problem, Hypothesis(), args.seed + i) for i in range(args.restarts)),
            *(Search(problem, alternative, args.seed) for alternative in ALTERNATIVES if args.refit),
        ]
    except (ValueError, ImportError) as error:
        print(f"identify.py: error: {error}", file=sys.stderr)
        return 2
    wanted = [args.generations if search.hypothesis == Hypothesis() else args.refit for search in searches]
    done = sum(search.generations for search in searches)
    try:
        with tqdm(total=sum(wanted), initial=done, desc="generations", leave=False, disable=None) as bar:
            for search, generations in zip(searches, wanted, strict=True):
                while search.generations < generations:
                    search.step()
                    files.write_bytes(out / "state.pkl", pickle.dumps((plan, searches)))
                    bar.set_postfix_str(f"{search.hypothesis.name}: RMS {100 * search.rms:.1f} %")
                    bar.update()
    except KeyboardInterrupt:
        print(f"identify.py: interrupted; the same command goes on from {out / 'state.pkl'}", file=sys.stderr)
        return 130
    text, data = report(problem, searches)
    files.write(out / "report.md", text)
    files.write(out / "report.json", json.dumps(data, indent=1) + "\n")
    print(text)
    return 0


def resume(path: Path, plan: dict[str, int]) -> list[Search] | None:
    """The searches of an interrupted run, or None where there was none.

    Raises:
        ValueError: it ran with other options.
    """
    if not path.exists():
        return None
    before, searches = pickle.loads(path.read_bytes())
    if before != plan:
        raise ValueError(f"{path} belongs to a run with {before}, not {plan}: choose another --out or remove it")
    return list(searches)


def report(problem: Table5, searches: Sequence[Search]) -> tuple[str, dict[str, Any]]:
    """What was found, as text and as data."""
    ours = sorted((s for s in searches if s.hypothesis == Hypothesis()), key=lambda s: s.best_cost)
    best = ours[0]
    settings = 10.0**best.best
    K = LQR.design(settings[:4], 1.0).K[0]
    off = problem.deviations(best.best[None], Hypothesis())[0]
    around = profile(problem, Hypothesis(), best.best, FACTORS)
    at_best = [float(np.sqrt(problem.cost(best.best[None], s.hypothesis)[0] / 16)) for s in searches]
    found = [[f"start {i + 1}", f"{100 * s.rms:.2f}", *(f"{v:.4g}" for v in 10.0**s.best)] for i, s in enumerate(ours)]
    cells = [
        (f"case {cell.case}", cell.state, cell.compensation, f"{100 * math.expm1(d):+.1f}")
        for cell, d in zip(problem.cells(), off, strict=True)
    ]
    profiles = [(name, *(f"{100 * rms:.1f}" for rms in row)) for name, row in zip(NAMES, around, strict=True)]
    rejected = [
        (s.hypothesis.name, f"{100 * held:.0f}", f"{100 * s.rms:.0f}")
        for s, held in zip(searches, at_best, strict=True)
        if s.hypothesis != Hypothesis()
    ]
    parts = [
        "# Identification of Table 5's LQR runs",
        f"Best: RMS of log(measured/published) {100 * best.rms:.2f} % over 16 cells, K = {np.round(K, 3).tolist()}.",
        "## Settings found from each random start",
        tabulate(found, ("", "RMS, %", *NAMES), tablefmt="github", disable_numparse=True),
        "## Residuals in percent",
        tabulate(cells, ("", "state", "compensation", "off, %"), tablefmt="github", disable_numparse=True),
        "## How well each setting is determined: RMS in percent when it alone is multiplied",
        tabulate(profiles, ("", *(f"by {f}" for f in FACTORS)), tablefmt="github", disable_numparse=True),
        "## Rejected hypotheses: RMS in percent",
        tabulate(rejected, ("", "same settings", "refitted"), tablefmt="github", disable_numparse=True),
    ]
    data = {
        "rms": best.rms,
        "settings": dict(zip(NAMES, settings.tolist(), strict=True)),
        "K": K.tolist(),
        "deviations": off.tolist(),
        "rejected": {s.hypothesis.name: s.rms for s in searches if s.hypothesis != Hypothesis()},
    }
    return "\n\n".join(parts) + "\n", data


if __name__ == "__main__":
    sys.exit(main())
