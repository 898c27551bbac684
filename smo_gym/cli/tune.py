"""Tune observers or laws, all with the same budget: CMA-ES on training runs that no table has.

    smo-gym tune simulated                     # on simulated encoders
    smo-gym tune cartpole --data DIR           # on the training recordings of a rig
    smo-gym tune laws --workers 2              # laws, on an estimate

Writes the settings with the numbers that it found, to be compared with those that come with the package.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from tqdm import tqdm

from .. import files
from ..evaluation import candidates, objectives
from ..evaluation.candidates import Candidate, Candidates
from ..evaluation.on_recordings import Runs
from ..evaluation.store import digest, kept
from ..evaluation.tuning import Tuned, tune
from ..recordings import RIGS, load
from . import computing
from .arguments import Parser, one_of, several, whole
from .entry import Stop, command
from .observers import chosen
from .tune_laws import tune_laws

SIMULATED, LAWS = "simulated", "laws"
WHERE = (SIMULATED, *RIGS, LAWS)


@command("tune")
def main(arguments: Sequence[str] | None = None) -> int:
    """Tune; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    parser = Parser("tune", __doc__)
    parser.add_argument("where", type=one_of("place", WHERE), metavar="WHERE", help=f"one of {', '.join(WHERE)}")
    parser.add_argument("--observer", default=None, metavar="NAME", help="some (default: all)", **several(str))
    parser.add_argument("--law", default=None, metavar="NAME", help="of the laws, some (default: all)", **several(str))
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of recordings, for a rig")
    parser.add_argument("--budget", type=whole(1), metavar="N", help="evaluations an observer (default: the settings')")
    parser.add_argument("--seed", type=whole(0), metavar="N", help="of the search (default: the settings')")
    parser.out("tuned")
    computing.add(parser)
    args = parser.parse_args(arguments)
    if (args.where in RIGS) != (args.data is not None):
        raise ValueError(f"--data {args.data}: the folder of recordings is of a rig, {args.where} has none")
    if args.where == LAWS:
        return tune_laws(args, args.budget, args.seed)
    settings = candidates.named(args.where)
    given = {name: value for name in ("budget", "seed") if (value := getattr(args, name)) is not None}
    settings = settings.model_copy(update=given)
    observers = {name: each for name, each in chosen(settings, args.observer).items() if each.tuned is not None}
    if not observers:
        raise ValueError(f"--observer {' '.join(args.observer)}: nothing of it is tuned")
    name = f"observers-{args.where}.yaml"
    if args.where == SIMULATED:
        objective: Any = objectives.simulated
    else:
        runs = Runs.of(RIGS[args.where], load(RIGS[args.where], args.data, "train"))
        objective = partial(objectives.on_runs, runs=runs)
    found: dict[str, Tuned] = {}
    with files.claimed(args.out, (name,)) as out, kept(out) as store:
        total = settings.budget * len(observers)
        try:
            with tqdm(total=total, unit="evaluation", desc="tuning", leave=False, disable=None) as bar:
                for each, candidate in observers.items():
                    found[each] = _one(candidate, settings, objective, store, bar.update)
        except KeyboardInterrupt:
            raise Stop(f"interrupted; the same command goes on from what is in {out}") from None
        files.write_set(out, {name: _written(settings, observers, found)})
    width = max(map(len, found))
    for each, tuned in found.items():
        print(f"{each:{width}}  {tuned.start:8.4g} -> {tuned.cost:8.4g}  {tuned.value}")
    print(f"\nresults are in {args.out}")
    return 0


def _one(candidate: Candidate, settings: Candidates, objective: Any, store: Any, told: Any) -> Tuned:
    assert candidate.tuned is not None
    begin = candidate.tuned.value
    told_of = candidate.model_dump(mode="json")
    key = digest(["tuning", told_of, settings.title, settings.budget, settings.seed, settings.scales])
    if (done := store.read(key)) is not None:
        told(settings.budget)
        value = candidates.with_leaves(begin, iter(done["value"].tolist()))
        return Tuned(value, float(done["cost"]), float(done["start"]), int(done["evaluations"]))
    cost = objective(candidate, scales=settings.scales)
    tuned = tune(cost, begin, settings.budget, settings.seed, told)
    numbers = np.array([number for _, number in candidates.leaves(tuned.value)])
    store.write(key, {"value": numbers, "cost": tuned.cost, "start": tuned.start, "evaluations": tuned.evaluations})
    return tuned


def _written(settings: Candidates, observers: dict[str, Candidate], found: dict[str, Tuned]) -> str:
    """The settings as YAML, with what was found."""
    data = settings.model_dump(mode="json", exclude_defaults=True)
    for name in observers:
        note = f"CMA-ES, {found[name].evaluations} evaluations; objective {found[name].cost:.4g}"
        data["observers"][name]["tuned"] = {"value": found[name].value, "source": "identified", "note": note}
    return yaml.safe_dump(data, sort_keys=False, width=120, default_flow_style=None)
