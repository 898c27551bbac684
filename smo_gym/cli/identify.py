"""Recover what the article does not print from what it does.

    smo-gym identify                        # LQR weights (R = 1) and observer slopes: Table 5's LQR cells
    smo-gym identify --target regulation    # SMC's k1..k4 and slope, Table 4's x(0): Tables 4 and 5
    smo-gym identify --target tracking      # SMC's k1..k4 of tracking: Table 7's averages
    smo-gym identify --target level         # Table 5's level by its likelihood, LQR's gain with its uncertainty
    smo-gym identify --target rivals        # equation (26) beside (34): two cases of Table 5 predict the others
    smo-gym identify --target structures    # what may stand behind Table 7's scatter

CMA-ES from random starts; then from the best point under each hypothesis to reject. The state is saved after every
generation: run the same command again to go on after an interruption. Writes report.md and report.json. Needs the extra
"reference" (cma).
"""

from __future__ import annotations

import json
import math
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tabulate import tabulate
from tqdm import tqdm

from .. import files
from ..evaluation import scenario
from ..evaluation.identify.search import Hypothesis, Problem, Search, cost, profile
from ..evaluation.identify.unprinted import Lqr, Regulation, Tracking
from ..validation import short
from .arguments import Parser, whole
from .entry import Stop, command
from .likelihoods import LIKELIHOODS, STATE, Costs, Report, Save, damaged

FACTORS = (0.8, 0.9, 1.1, 1.25)


@command("identify")
def main(arguments: Sequence[str] | None = None) -> int:
    """Search, or go on searching, and report; 0 when all went well, 2 for a bad argument, 130 when interrupted."""
    parser = Parser("identify", __doc__)
    add = parser.add_argument
    add("--target", choices=(*PROBLEMS, *LIKELIHOODS), default="lqr", help="default %(default)s")
    add("--restarts", type=whole(1), default=2, metavar="N", help="random starts (default 2)")
    add("--generations", type=whole(1), default=80, metavar="N", help="of each search (default 80)")
    add("--refit", type=whole(0), default=10, metavar="N", help="generations for each rejected hypothesis (default 10)")
    parser.seed("the first start")
    add("--out", type=Path, default=Path("identification"), metavar="DIR", help="default %(default)s")
    args = parser.parse_args(arguments)
    plan = {name: getattr(args, name) for name in ("target", "restarts", "generations", "refit", "seed")}
    with files.claimed(args.out, [STATE, "report.md", "report.json"]) as out:
        costs = resume(out / STATE, plan)

        def save(searches: Sequence[Search]) -> None:
            state = {"plan": plan, "costs": [search.costs for search in searches]}
            files.write(out / STATE, json.dumps(state) + "\n")

        try:
            text, data = LIKELIHOODS.get(args.target, unprinted)(args, costs, save)
        except KeyboardInterrupt:
            raise Stop(f"interrupted; the same command goes on from {out / STATE}") from None
        files.write_set(out, {"report.md": text, "report.json": json.dumps(data, indent=1) + "\n"})
    print(text)
    return 0


def unprinted(args: Namespace, costs: Sequence[Costs], save: Save) -> Report:
    """What is not printed, from random starts, and the hypotheses to reject."""
    problem = PROBLEMS[args.target]()
    searches = begun(args, problem, costs)
    search_on(args, problem, searches, save)
    return report(problem, searches)


def search_on(args: Namespace, problem: Problem, searches: list[Search], save: Save) -> None:
    """All generations that are left, and the rejected hypotheses from the best point; saved after each."""
    total = args.restarts * args.generations + args.refit * len(problem.alternatives)
    done = sum(search.generations for search in searches)
    with tqdm(total=total, initial=done, desc="generations", leave=False, disable=None) as bar:

        def run(search: Search, generations: int) -> None:
            while search.generations < generations:
                search.step()
                save(searches)
                bar.set_postfix_str(f"{search.hypothesis.name}: RMS {100 * search.rms:.1f} %")
                bar.update()

        for search in searches[: args.restarts]:
            run(search, args.generations)
        if len(searches) == args.restarts and args.refit:
            searches += rivals(args, problem, searches)
        for search in searches[args.restarts :]:
            run(search, args.refit)


PROBLEMS: dict[str, Callable[[], Problem]] = {
    "lqr": lambda: Lqr(scenario.named("initial-conditions")),
    "regulation": lambda: Regulation(scenario.named("initial-conditions"), scenario.named("regulation")),
    "tracking": lambda: Tracking(scenario.named("tracking")),
}


def rivals(args: Namespace, problem: Problem, searches: Sequence[Search], costs: Sequence[Costs] = ()) -> list[Search]:
    """A search under each hypothesis to reject, from the best point of all starts."""
    best = min(searches, key=lambda search: search.rms).best
    return [
        Search(problem, rival, args.seed, best, costs=known)
        for rival, known in zip(problem.alternatives, costs or [()] * len(problem.alternatives), strict=True)
    ]


def begun(args: Namespace, problem: Problem, costs: Sequence[Costs]) -> list[Search]:
    """The searches, those of an interrupted run where it was stopped.

    Raises:
        ValueError: the costs are not of such searches.
    """
    n = args.restarts
    starts = list(costs[:n]) or [()] * n
    try:
        if len(starts) != n or len(costs) not in (0, n, n + len(problem.alternatives)):
            raise ValueError(f"it holds {len(costs)} searches")
        searches = [Search(problem, Hypothesis(), args.seed + i, costs=known) for i, known in enumerate(starts)]
        return searches + (rivals(args, problem, searches, costs[n:]) if costs[n:] else [])
    except (ValueError, TypeError) as error:
        raise damaged(args, error) from None


def resume(path: Path, plan: dict[str, Any]) -> list[Costs]:
    """The costs of an interrupted run, search by search; none where there was no such run.

    Raises:
        ValueError: it ran with other options, or the file is damaged or of an older version.
    """
    if not path.exists():
        files.refuse_pickle(path.with_name("state.pkl"))
        return []
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        before, costs = state["plan"], list(state["costs"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ValueError(f"{path} is damaged: remove it to start anew") from None
    if not isinstance(before, dict) or before.keys() != plan.keys():
        raise ValueError(f"{path} is damaged: remove it to start anew")
    if others := [name for name in plan if before[name] != plan[name]]:
        there, here = (", ".join(f"--{name} {short(run[name])}" for name in others) for run in (before, plan))
        raise ValueError(f"{path} belongs to a run with {there}, not {here}: choose another --out or remove it")
    return costs


def report(problem: Problem, searches: Sequence[Search]) -> Report:
    """What was found, as text and as data."""
    ours = sorted((s for s in searches if s.hypothesis == Hypothesis()), key=lambda s: s.rms)
    best = ours[0]
    settings = 10.0**best.best
    names = list(problem.parameters)
    off = problem.deviations(best.best[None], Hypothesis())[0]
    around = profile(problem, Hypothesis(), best.best, FACTORS)
    at_best = [float(cost(problem, best.best[None], s.hypothesis)[0]) for s in searches]
    found = [[f"start {i + 1}", f"{100 * s.rms:.2f}", *(f"{v:.4g}" for v in 10.0**s.best)] for i, s in enumerate(ours)]
    cells = [(label, f"{100 * math.expm1(d):+.1f}") for label, d in zip(problem.labels(), off, strict=True)]
    profiles = [(name, *(f"{100 * rms:.1f}" for rms in row)) for name, row in zip(names, around, strict=True)]
    rejected = [
        (s.hypothesis.name, f"{100 * held:.0f}", f"{100 * s.rms:.0f}")
        for s, held in zip(searches, at_best, strict=True)
        if s.hypothesis != Hypothesis()
    ]
    parts = [
        "# Identification",
        f"Best: RMS of log(measured/published) {100 * best.rms:.2f} % over {len(off)} published numbers.",
        "## Settings found from each random start",
        tabulate(found, ("", "RMS, %", *names), tablefmt="github", disable_numparse=True),
        "## Residuals in percent",
        tabulate(cells, ("", "off, %"), tablefmt="github", disable_numparse=True),
        "## How well each setting is determined: RMS in percent when it alone is multiplied",
        tabulate(profiles, ("", *(f"by {f}" for f in FACTORS)), tablefmt="github", disable_numparse=True),
    ]
    if rejected:
        spent = max(s.generations for s in searches if s.hypothesis != Hypothesis())
        header = ("", "same settings", f"refitted, {spent} generations from them")
        parts.append("## Rejected hypotheses: RMS in percent")
        parts.append(tabulate(rejected, header, tablefmt="github", disable_numparse=True))
    data = {
        "rms": best.rms,
        "settings": dict(zip(names, settings.tolist(), strict=True)),
        "deviations": off.tolist(),
        "rejected": {s.hypothesis.name: s.rms for s in searches if s.hypothesis != Hypothesis()},
    }
    return "\n\n".join(parts) + "\n", data
