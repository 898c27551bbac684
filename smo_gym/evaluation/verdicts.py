"""What all runs together say: of the published cells, and of what the compensation costs."""

from __future__ import annotations

from collections.abc import Sequence

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


def costs(outcomes: Sequence[Outcome]) -> list[str]:
    """What the compensation costs, a line for each table and controller that ran with and without it.

    Over pairs of runs on the same plant that failed in neither arm, the nominal plant's left out.
    """
    pairs: dict[tuple[str, str], list[tuple[Outcome, Outcome]]] = {}
    arms = {(o.group.scenario.table, o.group.name, o.group.uncertainty, o.group.case, o.group.arm): o for o in outcomes}
    for (*place, arm), outcome in arms.items():
        other = arms.get((*place, WITH))  # type: ignore[arg-type]
        if arm == WITHOUT and other is not None and outcome.group.uncertainty > 0.0:
            pairs.setdefault((str(place[0]), str(place[1])), []).append((outcome, other))
    return [f"Table {table}, {name}: {_cost(both)}" for (table, name), both in pairs.items()]


def _cost(pairs: Sequence[tuple[Outcome, Outcome]]) -> str:
    both = [~(a.failed | b.failed) for a, b in pairs]

    def column(name: str) -> tuple[Array, Array]:
        without, compensated = (
            np.concatenate([pair[i].metrics[name][ok] for pair, ok in zip(pairs, both, strict=True)]) for i in (0, 1)
        )
        return without, compensated

    effort, force, speed = column("effort"), column("peak_force"), column("estimation_rms_h_dot")
    if not effort[0].size:
        return "no pair of runs stands."
    means = {
        name: [float(arm.mean()) for arm in values] for name, values in (("u", effort), ("F", force), ("v", speed))
    }
    return (
        f"without and with compensation, effort {means['u'][0]:.3g} and {means['u'][1]:.3g} N^2 s, mean peak force "
        f"{means['F'][0]:.3g} and {means['F'][1]:.3g} N, RMS error of the estimate of h' {means['v'][0]:.3g} and "
        f"{means['v'][1]:.3g} m/s, worse with it in {np.count_nonzero(speed[1] > speed[0])} of {speed[0].size} runs."
    )
