"""What all runs together say: of the published cells, and of what the compensation costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..article import WITH, WITHOUT
from ..typing import Array
from .study import Outcome

PRINTED_RUNS = 10
"""A cell of the article is a mean of so many runs."""
_RESAMPLES = 2000


def ceiling(values: Array) -> float:
    """How probably a printed cell, a mean of ten runs, has our mean within 10 % of it when every setting is exact.

    Means of ten are drawn with replacement from our runs, and our mean is taken for the true one: measured/published
    is within 10 % of 1. NaN from no more than ten runs, which say too little of their own scatter.

    Args:
        values: of one cell, one a run.
    """
    if values.size <= PRINTED_RUNS:
        return float("nan")
    drawn = np.random.default_rng(0).choice(values, (_RESAMPLES, PRINTED_RUNS)).mean(axis=1)
    return float(np.mean(np.abs(values.mean() / drawn - 1.0) <= 0.1))


@dataclass(frozen=True, slots=True)
class Cost:
    """Means without and with compensation over pairs of runs on the same plant that failed in neither arm."""

    effort: tuple[float, float]
    """In N^2 s."""
    peak_force: tuple[float, float]
    """In N."""
    speed_error: tuple[float, float]
    """RMS error of the estimate of h', in m/s."""
    worse: int
    """In how many pairs the speed's error is larger with compensation."""
    pairs: int


def costs(outcomes: Sequence[Outcome]) -> dict[tuple[str, str], Cost]:
    """What the compensation costs, by table and controller that ran with and without it; the nominal plant's left out.

    NaN where no pair of runs stands.
    """
    pairs: dict[tuple[str, str], list[tuple[Outcome, Outcome]]] = {}
    arms = {(o.group.scenario.table, o.group.name, o.group.uncertainty, o.group.case, o.group.arm): o for o in outcomes}
    for (*place, arm), outcome in arms.items():
        other = arms.get((*place, WITH))  # type: ignore[arg-type]
        if arm == WITHOUT and other is not None and outcome.group.uncertainty > 0.0:
            pairs.setdefault((str(place[0]), str(place[1])), []).append((outcome, other))
    return {where: _cost(both) for where, both in pairs.items()}


def cost_lines(outcomes: Sequence[Outcome]) -> list[str]:
    """The same in words, a line for each table and controller."""
    return [f"Table {table}, {name}: {_said(cost)}" for (table, name), cost in costs(outcomes).items()]


def _cost(pairs: Sequence[tuple[Outcome, Outcome]]) -> Cost:
    both = [~(a.failed | b.failed) for a, b in pairs]

    def column(name: str) -> tuple[Array, Array]:
        without, compensated = (
            np.concatenate([pair[i].metrics[name][ok] for pair, ok in zip(pairs, both, strict=True)]) for i in (0, 1)
        )
        return without, compensated

    def means(name: str) -> tuple[float, float]:
        without, compensated = column(name)
        return (float(without.mean()), float(compensated.mean())) if without.size else (math.nan, math.nan)

    speed = column("estimation_rms_h_dot")
    return Cost(
        effort=means("effort"),
        peak_force=means("peak_force"),
        speed_error=means("estimation_rms_h_dot"),
        worse=int(np.count_nonzero(speed[1] > speed[0])),
        pairs=speed[0].size,
    )


def _said(cost: Cost) -> str:
    if not cost.pairs:
        return "no pair of runs stands."
    effort, force, speed = (
        f"{without:.3g} and {compensated:.3g}"
        for without, compensated in (cost.effort, cost.peak_force, cost.speed_error)
    )
    return (
        f"without and with compensation, effort {effort} N^2 s, mean peak force {force} N, RMS error of the estimate "
        f"of h' {speed} m/s, worse with it in {cost.worse} of {cost.pairs} runs."
    )
