"""One tuner for all: CMA-ES over the logarithms of an observer's or a law's numbers, with the same budget for each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..typing import Array
from ..validation import number, whole
from .candidates import Tree, leaves, with_leaves

SPREAD = 0.7
"""First standard deviation of the logarithms: about a factor of 2 up or down."""
RANGE = 1000.0
"""Numbers stay within this factor of where they begin: one that runs away, as a filter's cutoff may, ends there."""
LOST = 1e6
"""Cost of settings that are refused, or with which nothing finite comes about: less than that is better."""


@dataclass(frozen=True, slots=True)
class Tuned:
    """What a search found."""

    value: Tree
    cost: float
    start: float
    """Cost of what it began with."""
    evaluations: int


def tune(
    cost: Callable[[Tree], float],
    start: Tree,
    budget: int,
    seed: int,
    told: Callable[[int], object] = lambda evaluations: None,
) -> Tuned:
    """The tree of numbers with the least cost that ``budget`` evaluations find; each keeps the sign it begins with.

    Args:
        cost: of a tree; a ``ValueError`` says that it is not allowed, which is never better than one that is.
        start: where to begin.
        budget: evaluations of ``cost``; the last generation may be cut.
        seed: of the search.
        told: called with the number of evaluations done since the last call.

    Raises:
        ValueError: a number of ``start`` is 0 or not finite, or nothing that was tried is allowed.
        ImportError: the package cma is missing.
    """
    try:
        import cma
    except ImportError:
        raise ImportError('tuning needs cma: pip install "smo_gym[reference]"') from None
    given = [number(place, value) for place, value in leaves(start)]
    if zeros := [place for (place, _), value in zip(leaves(start), given, strict=True) if value == 0.0]:
        raise ValueError(f"{zeros[0]}=0 must be another number: it is varied by factors")
    begin, signs = np.log(np.abs(given)), np.sign(given)
    whole("budget", budget, 1)

    def tried(point: Array) -> float:
        try:
            found = cost(with_leaves(start, iter((signs * np.exp(point)).tolist())))
        except (ValueError, OverflowError):
            return LOST
        return found if math.isfinite(found) and found < LOST else LOST

    best, least = begin, tried(begin)
    first, done = least, 1
    told(1)
    # one number alone is no search space for CMA-ES: it gets a second one, which does nothing
    idle = [0.0] if len(begin) == 1 else []
    middle = np.array([*begin, *idle])
    bounds = [(middle - math.log(RANGE)).tolist(), (middle + math.log(RANGE)).tolist()]
    options: dict[str, Any] = {"seed": seed + 1, "verbose": -9, "bounds": bounds}  # cma takes a seed of 0 for the clock
    search: Any = cma.CMAEvolutionStrategy(middle, SPREAD, options)
    while done < budget and not search.stop():
        points = search.ask()
        costs = [tried(point[: len(begin)]) if done + i < budget else LOST for i, point in enumerate(points)]
        search.tell(points, costs)
        more = min(len(points), budget - done)
        done += more
        told(more)
        i = int(np.argmin(costs))
        if costs[i] < least:
            best, least = points[i][: len(begin)], costs[i]
    if least >= LOST:
        raise ValueError(f"none of {done} settings tried gives finite numbers: begin elsewhere than {start!r}")
    return Tuned(with_leaves(start, iter(_short(signs * np.exp(best)))), least, first, done)


def _short(point: Array) -> list[float]:
    """To four digits: more is not known."""
    return [float(f"{value:.4g}") for value in point]
