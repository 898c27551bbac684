"""The numbers that a report begins with: what the compensation does, what it costs, and the score."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...article import WITH, WITHOUT
from .. import formats
from ..arms import ARMS
from ..statistics import Result
from ..study import Outcome
from . import tables

_NONE = "none"  # every run failed


class Number(NamedTuple):
    """A number as it is shown: what it is of, itself, what stands beside it, and what more is to say."""

    name: str
    text: str
    beside: str
    note: str


class Effect(NamedTuple):
    """The three numbers of one controller's table."""

    table: str
    controller: str
    over: str
    """The row that they come from."""
    numbers: tuple[Number, Number, Number]


class Score(NamedTuple):
    """How many published cells are within 10 %, and how many would be if only ten runs' scatter kept them off."""

    cells: int
    near: int
    ceiling: float
    """NaN from ten runs or fewer."""


def effects(outcomes: Sequence[Outcome], results: Sequence[Result]) -> list[Effect]:
    """Of each table and controller: the reductions of the MSE of h and theta, and what the force did for them.

    From the row of averages, or the last where there is none; where the runs have not both printed arms, the MSE
    itself in the first arm that they have.
    """
    found = []
    for (table, controller), rows in tables.by_table(results).items():
        here = [o for o in outcomes if (o.group.scenario.table, o.group.name) == (table, controller)]
        arms = {arm: chosen for arm in ARMS if (chosen := [o for o in here if o.group.arm == arm])}
        if {WITHOUT, WITH} <= arms.keys():
            last = {r.cell.state: r for r in rows if r.cell.metric == tables.REDUCTION}
            states = [_reduction(last[state], state) for state in ("h", "theta")]
            force = _force({arm: arms[arm] for arm in (WITHOUT, WITH)})
        else:
            arm = next(iter(arms))
            last = {r.cell.state: r for r in rows if r.cell.metric == "mse" and r.cell.compensation == arm}
            states = [_mse(last[state], state) for state in ("h", "theta")]
            force = _force({arm: arms[arm]})
        over = tables.label(last["h"].cell)
        found.append(Effect(formats.line(table), tables.title(controller), over, (states[0], states[1], force)))
    return found


def score(results: Sequence[Result]) -> Score | None:
    """The score over all tables; None where nothing is published."""
    cells = tables.compared(results)
    return Score(len(cells), sum(map(tables.within, cells)), tables.ceiling(cells)) if cells else None


def _reduction(row: Result, state: str) -> Number:
    return Number(
        f"Reduction of the MSE of {_symbol(state)}",
        _percent(row.measured),
        f"{_percent(row.published)} published" if math.isfinite(row.published) else "nothing published",
        f"95 % interval {_percent(row.ci_low)} to {_percent(row.ci_high)}" if math.isfinite(row.ci_low) else "",
    )


def _mse(row: Result, state: str) -> Number:
    return Number(
        f"MSE of {_symbol(state)}, {ARMS[row.cell.compensation].title}",
        f"{_plain(row.measured)} {'m²' if state == 'h' else 'rad²'}",
        f"{_plain(row.published)} published" if math.isfinite(row.published) else "nothing published",
        f"95 % interval {_plain(row.ci_low)} to {_plain(row.ci_high)}" if math.isfinite(row.ci_low) else "",
    )


def _force(arms: Mapping[str, Sequence[Outcome]]) -> Number:
    """Effort and peak force, without → with: over plants whose runs failed in no arm, the nominal plant's left out."""
    effort, peak = _means("effort", arms), _means("peak_force", arms)
    both = len(effort) == 2
    return Number(
        "Its cost: effort in N² s, without → with" if both else "Effort ∫F² dt in N² s",
        " → ".join(map(_plain, effort)),
        f"{effort[1] / effort[0]:.1f} times" if both and effort[0] > 0.0 else "",
        f"mean peak force {' → '.join(map(_plain, peak))} N",
    )


def _means(metric: str, arms: Mapping[str, Sequence[Outcome]]) -> list[float]:
    uncertain = {arm: [o for o in chosen if o.group.uncertainty > 0.0] or chosen for arm, chosen in arms.items()}
    stood = [~np.any([o.failed for o in alike], axis=0) for alike in zip(*uncertain.values(), strict=True)]
    means = []
    for chosen in uncertain.values():
        values = np.concatenate([o.metrics[metric][ok] for o, ok in zip(chosen, stood, strict=True)])
        means.append(float(values.mean()) if values.size else math.nan)
    return means


def _symbol(state: str) -> str:
    return "θ" if state == "theta" else state


def _percent(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f} %".replace("-", "−") if math.isfinite(value) else _NONE


def _plain(value: float) -> str:
    """Three digits; a large number in full."""
    if not math.isfinite(value):
        return _NONE
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"
