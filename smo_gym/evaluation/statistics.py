"""From runs to the cells of a table: means, medians, Student's intervals, reductions, beside what was published."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from ..article import Cell, published
from ..typing import Array, Flags
from .arms import ARMS, PRINTED
from .study import Outcome
from .verdicts import PRINTED_RUNS, ceiling


@dataclass(frozen=True, slots=True)
class Result:
    """One number of a table. NaN where there is none."""

    cell: Cell
    published: float
    measured: float
    ci_low: float
    ci_high: float
    median: float
    runs: int
    failures: int
    half_width: float = math.nan
    """Half-width of the 95 % prediction interval around ``measured`` for a mean of ten further runs: a printed cell."""
    ceiling: float = math.nan
    """How probably a mean of ten further runs lies within 10 % of ``measured``."""

    @property
    def deviation(self) -> float:
        """log(measured / published)."""
        return math.log(self.measured / self.published) if self.published > 0.0 and self.measured > 0.0 else math.nan


Row = tuple[list[Outcome], str, str]
"""Outcomes, one an arm (for an average: several), and the columns uncertainty_percent and case."""


def results(outcomes: Sequence[Outcome]) -> list[Result]:
    """All numbers of all tables: MSE and, where the article has it, RMS; reductions by the compensation; averages.

    A mean is over the runs that did not fail; ``failures`` counts the others (in a row of averages, the runs that
    failed in any of its rows). Intervals are Student's 95 % intervals of the mean over runs: right for ten runs of
    mild tails; where the median is far from the mean, more runs are needed. RMS is the root of the mean MSE, as in the
    article. A reduction is ``100 (1 - with / without)`` in percent, over pairs of runs on the same plant. The row
    "average" is over the published rows, as the article's, and its reduction is that of the averages (the article's
    Table 4; its Table 5 averages the reductions). Nothing is published where anything
    stands between plant and computer.
    """
    found: list[Result] = []
    for rows, uncertainty, case in _rows(outcomes):
        for state in ("h", "theta"):
            for arm in ARMS:
                chosen = [row for row in rows if row.group.arm == arm]
                found += _cells(chosen, state, uncertainty, case) if chosen else []
            found += _reduction(rows, state, uncertainty, case)
    scenarios = {id(outcome.group.scenario): outcome.group.scenario for outcome in outcomes}.values()
    others = {place.table for place in scenarios if not place.task.exact}
    return [replace(each, published=math.nan) if each.cell.table in others else each for each in found]


def _rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """The rows of each controller's tables in order, and its average over all rows but the nominal plant's."""
    tables: dict[tuple[str, str], dict[tuple[str, str], list[Outcome]]] = {}
    for outcome in outcomes:
        table = tables.setdefault((outcome.group.scenario.table, outcome.group.name), {})
        table.setdefault(place(outcome), []).append(outcome)
    found: list[Row] = []
    for table in tables.values():
        found += [(rows, *where) for where, rows in table.items()]
        uncertain = [outcome for rows in table.values() for outcome in rows if outcome.group.uncertainty > 0.0]
        cases = any(uncertain[0].group.scenario.initial_states.value) if uncertain else False
        if uncertain:
            found.append((uncertain, "" if cases else "average", "average" if cases else ""))
    return found


def place(outcome: Outcome) -> tuple[str, str]:
    """The columns uncertainty_percent and case; Table 5 leaves the level of its runs out, as printed."""
    group = outcome.group
    levels = group.scenario.uncertainty.value
    named = any(group.scenario.initial_states.value) and len(levels) == 1 and group.uncertainty == levels[0]
    return "" if named else f"{100 * group.uncertainty:.10g}", group.case


def _cells(rows: Sequence[Outcome], state: str, uncertainty: str, case: str) -> list[Result]:
    """MSE and RMS of one arm, averaged over rows."""
    group = rows[0].group
    cell = Cell(group.scenario.table, group.name, uncertainty, case, "mse", state, group.arm)
    values, complete = _runs(rows, state)
    low, high = _interval(values[complete])
    mse = Result(
        cell=cell,
        published=_published(rows, cell),
        measured=_mean(values[complete]),
        ci_low=max(low, 0.0),
        ci_high=high,
        median=float(np.median(values[complete])) if complete.any() else math.nan,
        runs=len(values),
        failures=int(np.count_nonzero(~complete)),
        half_width=_prediction(values[complete]),
        ceiling=ceiling(values[complete]),
    )
    if not any(known.table == cell.table and known.metric == "rms" for known in published()):
        return [mse]
    rms_cell = replace(cell, metric="rms")
    rms = replace(
        mse,
        cell=rms_cell,
        published=_published(rows, rms_cell),
        measured=math.sqrt(mse.measured),
        ci_low=math.sqrt(mse.ci_low),
        ci_high=math.sqrt(mse.ci_high),
        median=math.sqrt(mse.median),
        half_width=math.nan,
        ceiling=math.nan,
    )
    return [mse, rms]


def _runs(rows: Sequence[Outcome], state: str) -> tuple[Array, Flags]:
    """MSE of each run, averaged over rows, and which runs failed in none of them."""
    values = np.mean([np.where(row.failed, np.nan, row.metrics[f"mse_{state}"]) for row in rows], axis=0)
    return values, np.isfinite(values)


def _published(rows: Sequence[Outcome], cell: Cell) -> float:
    """The printed number; of an average, the mean of the printed cells that it averages."""
    keys = [replace(cell, uncertainty_percent=level, case=case) for level, case in map(place, rows)]
    numbers = [published().get(key, math.nan) for key in keys]
    return float(np.mean(numbers))


def _reduction(rows: Sequence[Outcome], state: str, uncertainty: str, case: str) -> list[Result]:
    """What the compensation takes off the MSE, in percent, over runs that failed in neither arm."""
    arms = {arm: [row for row in rows if row.group.arm == arm] for arm in PRINTED}
    if not all(arms.values()):
        return []
    (without, ok_without), (with_, ok_with) = (_runs(arm, state) for arm in arms.values())
    both = ok_without & ok_with
    a, b = without[both], with_[both]
    ratio = _mean(b) / _mean(a)
    # the ratio of two means to first order: each pair's share in the deviation from it (delta method)
    low, high = _interval(100.0 * (1.0 - ratio - (b - ratio * a) / _mean(a)))
    group = rows[0].group
    cells = [Cell(group.scenario.table, group.name, uncertainty, case, "mse", state, arm) for arm in arms]
    printed = [_published(arm, cell) for arm, cell in zip(arms.values(), cells, strict=True)]
    return [
        Result(
            cell=replace(cells[0], metric="mse_reduction_percent", compensation=""),
            published=100.0 * (1.0 - printed[1] / printed[0]),
            measured=100.0 * (1.0 - ratio),
            ci_low=low,
            ci_high=high,
            median=float(np.median(100.0 * (1.0 - b / a))) if both.any() else math.nan,
            runs=len(both),
            failures=int(np.count_nonzero(~both)),
        )
    ]


def _mean(values: Array) -> float:
    return float(np.mean(values)) if values.size else math.nan


def _prediction(values: Array) -> float:
    """Half-width of the 95 % prediction interval for a mean of ten further runs, Student's."""
    n = values.size
    if n < 2:
        return math.nan
    return float(stdtrit(n - 1, 0.975) * values.std(ddof=1) * math.sqrt(1.0 / n + 1.0 / PRINTED_RUNS))


def _interval(values: Array) -> tuple[float, float]:
    """The 95 % interval of the mean over runs, Student's; none for fewer than two, a point where all agree."""
    n = values.size
    if n < 2:
        return math.nan, math.nan
    if np.ptp(values) == 0.0:
        return float(values[0]), float(values[0])
    mean = values.mean()
    error = np.sqrt(np.mean((values - mean) ** 2) * (n / (n - 1)) / n)
    tail = (1.0 - 0.95) / 2.0
    return float(stdtrit(n - 1, tail) * error + mean), float(stdtrit(n - 1, 1.0 - tail) * error + mean)
