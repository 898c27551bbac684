"""What ``smo-gym tune laws`` does: every law in every family of cases, with the same budget."""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import yaml
from tqdm import tqdm

from .. import files
from ..evaluation import candidates, law_settings
from ..evaluation.law_objective import TRAINING, of_law
from ..evaluation.law_settings import Laws
from ..evaluation.store import digest
from ..evaluation.tuning import Tuned, tune
from . import computing

RESULT = "laws.yaml"
Piece = tuple[str, str]
"""A law and a family."""


def tune_laws(args: argparse.Namespace, budget: int | None, seed: int | None) -> int:
    """Tune; 0 when all went well.

    Raises:
        ValueError: an unknown law or family.
    """
    laws = law_settings.named()
    changes = {name: value for name, value in (("budget", budget), ("seed", seed)) if value is not None}
    laws = laws.model_copy(update=changes)
    names = [name for name in args.law or laws.laws if laws[name].tuned]
    if not names:
        raise ValueError(f"--law {' '.join(args.law)}: nothing of it is tuned")
    pieces = [each for each in product(names, TRAINING) if each[1] in laws[each[0]].tuned]
    with files.claimed(args.out, (RESULT,)) as out, computing.working(args, out) as (mapped, store):
        keys = {each: _key(laws, each) for each in pieces}
        found = {each: _kept(done) for each in pieces if (done := store.read(keys[each])) is not None}
        left = [each for each in pieces if each not in found]
        with tqdm(total=len(pieces), unit="search", desc="tuning", leave=False, disable=None) as bar:
            bar.update(len(found))
            for each, arrays in mapped(partial(search, laws), left):
                store.write(keys[each], arrays)
                found[each] = _kept(arrays)
                bar.update()
        files.write_set(out, {RESULT: _written(laws, found)})
    for name, family in pieces:
        numbers, start, cost, _ = found[name, family]
        print(f"{name:20} {family:20} {start:8.4g} -> {cost:8.4g}  {numbers}")
    print(f"\nresults are in {args.out}")
    return 0


def search(laws: Laws, piece: Piece) -> tuple[Piece, dict[str, Any]]:
    """What a search finds, and which it was: they come as they are done."""
    name, family = piece
    tuned: Tuned = tune(of_law(laws, name, family), laws[name].tuned[family].value, laws.budget, laws.seed)
    numbers = np.array([number for _, number in candidates.leaves(tuned.value)])
    return piece, {"value": numbers, "cost": tuned.cost, "start": tuned.start, "evaluations": tuned.evaluations}


def _key(laws: Laws, piece: Piece) -> str:
    name, family = piece
    told = laws.model_dump(mode="json", exclude={"laws"})
    return digest(["tuning", told, name, family, laws[name].model_dump(mode="json")])


def _kept(arrays: dict[str, Any]) -> tuple[list[float], float, float, int]:
    return (
        np.asarray(arrays["value"]).tolist(),
        float(arrays["start"]),
        float(arrays["cost"]),
        int(arrays["evaluations"]),
    )


def _written(laws: Laws, found: dict[Piece, tuple[list[float], float, float, int]]) -> str:
    """The settings as YAML, with what was found."""
    data = laws.model_dump(mode="json", exclude_defaults=True)
    for (name, family), (numbers, _, cost, evaluations) in found.items():
        tree = candidates.with_leaves(laws[name].tuned[family].value, iter(numbers))
        note = f"CMA-ES, {evaluations} evaluations; objective {cost:.4g}"
        data["laws"][name]["tuned"][family] = {"value": tree, "source": "identified", "note": note}
    return yaml.safe_dump(data, sort_keys=False, width=120, default_flow_style=None)
