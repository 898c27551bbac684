"""From runs to the cells of a table: means, medians, bootstrap intervals, reductions, beside what was published."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..article import Cell, published
from .study import ARMS, Outcome

Array = NDArray[np.float64]
_RESAMPLES = 1999


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

    @property
    def deviation(self) -> float:
        """log(measured / published)."""
        return math.log(self.measured / self.published) if self.published > 0.0 and self.measured > 0.0 else math.nan


Row = tuple[list[Outcome], str, str]
"""Outcomes, one an arm (for an average: several), and the columns uncertainty_percent and case."""


def results(outcomes: Sequence[Outcome]) -> list[Result]:
    """All numbers of all tables: MSE and, where the article has it, RMS; reductions by the compensation; averages.

    A mean is over the runs that did not fail; ``failures`` counts the others. Intervals are 95 % BCa bootstrap
    intervals over runs. RMS is the root of the mean MSE, as in the article. A reduction is ``100 (1 - with / without)``
    in percent, its interval from pairs of runs on the same plant. The row "average" is over the published rows, as the
    article's, and its reduction is that of the averages (the article's Table 4; its Table 5 averages the reductions).
    """
    found: list[Result] = []
    for rows, uncertainty, case in _rows(outcomes):
        for state in ("h", "theta"):
            for arm in ARMS:
                chosen = [row for row in rows if row.group.arm == arm]
                found += _cells(chosen, state, uncertainty, case) if chosen else []
            found += _reduction(rows, state, uncertainty, case)
    return found


def _rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """The rows of each controller's tables in order, and its average over all rows but the nominal plant's."""
    tables: dict[tuple[str, str], dict[tuple[str, str], list[Outcome]]] = {}
    for outcome in outcomes:
        table = tables.setdefault((outcome.group.scenario.table, outcome.group.controller), {})
        table.setdefault(_place(outcome), []).append(outcome)
    found: list[Row] = []
    for table in tables.values():
        found += [(rows, *place) for place, rows in table.items()]
        uncertain = [outcome for rows in table.values() for outcome in rows if outcome.group.uncertainty > 0.0]
        cases = any(uncertain[0].group.scenario.initial_states.value) if uncertain else False
        if uncertain:
            found.append((uncertain, "" if cases else "average", "average" if cases else ""))
    return found


def _place(outcome: Outcome) -> tuple[str, str]:
    """The columns uncertainty_percent and case; Table 5 leaves the level of its runs out, as printed."""
    group = outcome.group
    levels = group.scenario.uncertainty.value
    named = any(group.scenario.initial_states.value) and len(levels) == 1 and group.uncertainty == levels[0]
    return "" if named else f"{100 * group.uncertainty:.10g}", group.case


def _cells(rows: Sequence[Outcome], state: str, uncertainty: str, case: str) -> list[Result]:
    """MSE and RMS of one arm, averaged over rows."""
    group = rows[0].group
    cell = Cell(group.scenario.table, group.controller, uncertainty, case, "mse", state, group.arm)
    values = np.mean([np.where(row.failed, np.nan, row.metrics[f"mse_{state}"]) for row in rows], axis=0)
    complete = values[np.isfinite(values)]
    measured = float(np.mean([_mean_of(row, state) for row in rows]))
    low, high = _interval((complete,), _mean)
    mse = Result(
        cell=cell,
        published=_published(rows, state, cell),
        measured=measured,
        ci_low=low,
        ci_high=high,
        median=float(np.median(complete)) if complete.size else math.nan,
        runs=sum(len(row.failed) for row in rows),
        failures=sum(int(row.failed.sum()) for row in rows),
    )
    if not any(known.table == cell.table and known.metric == "rms" for known in published()):
        return [mse]
    rms_cell = replace(cell, metric="rms")
    printed = _published(rows, state, rms_cell)
    rms = replace(
        mse,
        cell=rms_cell,
        published=printed,
        measured=math.sqrt(mse.measured),
        ci_low=math.sqrt(mse.ci_low),
        ci_high=math.sqrt(mse.ci_high),
        median=math.sqrt(mse.median),
    )
    return [mse, rms]


def _published(rows: Sequence[Outcome], state: str, cell: Cell) -> float:
    """The printed number; of an average, the mean of the printed cells that it averages."""
    keys = [replace(cell, uncertainty_percent=level, case=case) for level, case in map(_place, rows)]
    numbers = [published().get(key, math.nan) for key in keys]
    return float(np.mean(numbers))


def _mean_of(row: Outcome, state: str) -> float:
    values = row.metrics[f"mse_{state}"][~row.failed]
    return float(np.mean(values)) if values.size else math.nan


def _reduction(rows: Sequence[Outcome], state: str, uncertainty: str, case: str) -> list[Result]:
    """What the compensation takes off the MSE, in percent; nothing where an arm is missing."""
    arms = {arm: [row for row in rows if row.group.arm == arm] for arm in ("without", "with")}
    if not all(arms.values()):
        return []
    without, with_ = (_cells(arm, state, uncertainty, case)[0] for arm in arms.values())
    values = [
        np.mean([np.where(row.failed, np.nan, row.metrics[f"mse_{state}"]) for row in arm], axis=0)
        for arm in arms.values()
    ]
    both = np.isfinite(values[0]) & np.isfinite(values[1])
    pairs = (values[0][both], values[1][both])

    def percent(a: Array, b: Array, axis: int = -1) -> Array:
        return np.asarray(100.0 * (1.0 - np.mean(b, axis=axis) / np.mean(a, axis=axis)))

    low, high = _interval(pairs, percent)
    return [
        Result(
            cell=replace(without.cell, metric="mse_reduction_percent", compensation=""),
            published=100.0 * (1.0 - with_.published / without.published),
            measured=100.0 * (1.0 - with_.measured / without.measured),
            ci_low=low,
            ci_high=high,
            median=float(np.median(100.0 * (1.0 - pairs[1] / pairs[0]))) if both.any() else math.nan,
            runs=int(both.size),
            failures=int((~both).sum()),
        )
    ]


def _mean(values: Array, axis: int) -> Array:
    return np.asarray(np.mean(values, axis=axis))


def _interval(samples: tuple[Array, ...], statistic: Callable[..., Array]) -> tuple[float, float]:
    """The 95 % interval over runs; none for fewer than two runs, a point where all runs agree."""
    if samples[0].size < 2:
        return math.nan, math.nan
    if all(np.ptp(sample) == 0.0 for sample in samples):
        point = float(statistic(*samples, axis=-1))
        return point, point
    interval = stats.bootstrap(
        samples,
        statistic,
        paired=len(samples) > 1,
        vectorized=True,
        n_resamples=_RESAMPLES,
        batch=200,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)
