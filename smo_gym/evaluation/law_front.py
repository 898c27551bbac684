"""What a law gives for a smoother force: tuned under several weights of its variation, measured on other plants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..typing import Array
from . import candidates
from .law_cases import run
from .law_objective import TRAINING, of_law
from .law_settings import Laws
from .law_table import Cell, Row, row
from .tuning import tune

WEIGHTS = (0.02, 0.1, 0.5)
"""Of the logarithm of the total variation in the objective; what ships is under the family's own."""
FAMILIES = ("regulation-filtered", "upright-filtered")

Piece = tuple[str, str, float]
"""A law, a family and a weight."""


def pieces(laws: Laws, names: Sequence[str]) -> list[Piece]:
    """All searches; of laws that are tuned in these families, and stand somewhere under the shipped numbers."""
    return [
        (name, family, weight)
        for name in names
        for family in FAMILIES
        if family in laws[name].tuned and laws[name].period is None
        for weight in WEIGHTS
    ]


def search(laws: Laws, piece: Piece) -> tuple[Piece, dict[str, Any]]:
    """The numbers that a law has under a weight; they begin with those that ship."""
    name, family, weight = piece
    start = laws[name].tuned[family].value
    if weight == laws.families[family].smoothness:
        return piece, {"value": np.array([number for _, number in candidates.leaves(start)])}
    settings = laws.families[family].model_copy(update={"smoothness": weight})
    weighed = laws.model_copy(update={"families": {**laws.families, family: settings}})
    tuned = tune(of_law(weighed, name, family), start, laws.budget, laws.seed)
    return piece, {"value": np.array([number for _, number in candidates.leaves(tuned.value)])}


def points(laws: Laws, piece: Piece, numbers: Array, runs: int, seed: int) -> list[Row]:
    """Its rows on other plants: where it was tuned, and outside of that."""
    name, family, _ = piece
    tree = candidates.with_leaves(laws[name].tuned[family].value, iter(numbers.tolist()))
    place = TRAINING[family]
    place = replace(place, estimate=laws[name].estimate or place.estimate)
    found = []
    for outside in (False, True):
        cell = Cell(replace(place, outside=outside), name, runs, seed)
        found.append(row(cell, run(cell.place, laws.of(name, family, tree), runs, seed)))
    return found
