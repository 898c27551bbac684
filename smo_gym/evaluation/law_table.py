"""The table of laws: which cells it has, and a row for each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from ..typing import Array
from .law_cases import ESTIMATES, Estimate, Place, run
from .law_settings import Laws

SLOW_RUNS = 20
"""Plants, the first ones, of a law that is slow."""
SLOW_ON = ("ekf", "true")
SLOW_SENSORS = ("exact", "noise")
"""Where slow laws run."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A law at a place."""

    place: Place
    law: str
    runs: int
    seed: int


@dataclass(frozen=True, slots=True)
class Row:
    """What a cell gave: means over the runs that did not fail."""

    case: str
    disturbed: str
    """yes or no."""
    law: str
    observer: str
    start: str
    """Of the estimate: zero or measured."""
    sensor: str
    control_period: float
    mse_h: float
    mse_theta: float
    iae_h: float
    iae_theta: float
    effort: float
    total_variation: float
    peak_force: float
    failures: int
    runs: int
    late_variation: float
    """Total variation in the last 5 s, in N: the median of the runs."""
    outside: str
    """Whether plants and disturbance are beyond what was tuned on: yes or no."""
    mse_h_low: float
    mse_h_high: float
    mse_theta_low: float
    mse_theta_high: float
    total_variation_low: float
    total_variation_high: float
    failures_low: float
    """Of the share of runs that fail; like the others an interval of 95 %."""
    failures_high: float


def cells(
    laws: Laws,
    names: Sequence[str],
    observers: Sequence[str],
    cases: Sequence[str],
    sensors: Sequence[str],
    periods: Sequence[float],
    runs: int,
    seed: int,
    outside: bool = False,
) -> list[Cell]:
    """Every law at every place where it can act, undisturbed and disturbed."""
    found = []
    for case in cases:
        for disturbed in (True,) if outside else (False, True):
            for period in periods:
                for name in names:
                    law = laws[name]
                    if law.slow and period == min(periods) and len(periods) > 1:
                        continue
                    for estimate, sensor in _seen(law.estimate, law.slow, observers, sensors):
                        place = Place(case, estimate, sensor, period, disturbed, outside)
                        if law.acts(place.family):
                            found.append(Cell(place, name, min(runs, SLOW_RUNS) if law.slow else runs, seed))
    return found


def _seen(
    own: Estimate | None, slow: bool, observers: Sequence[str], sensors: Sequence[str]
) -> Iterator[tuple[Estimate, str]]:
    for estimate in [own] if own else [each for each in ESTIMATES if each.observer in observers]:
        for sensor in sensors:
            if estimate.observer == "true" and sensor != "exact":
                continue  # it sees the state, whatever is measured
            if slow and (estimate.observer not in SLOW_ON or sensor not in SLOW_SENSORS):
                continue
            yield estimate, sensor


def measured(laws: Laws, cell: Cell) -> dict[str, Array]:
    """What the runs of a cell gave."""
    return run(cell.place, laws.of(cell.law, cell.place.family), cell.runs, cell.seed)


def row(cell: Cell, found: dict[str, Array]) -> Row:
    """A cell's row."""
    place, failed = cell.place, found["failed"] > 0.0
    stood = {name: values[~failed] for name, values in found.items()}
    (h, h_low, h_high), (theta, theta_low, theta_high), (variation, least, most) = (
        _mean(stood[name]) for name in ("mse_h", "mse_theta", "total_variation")
    )
    failures = stats.binomtest(int(failed.sum()), cell.runs).proportion_ci(method="wilson")
    return Row(
        case=place.case,
        disturbed=_said(place.disturbed),
        law=cell.law,
        observer=place.estimate.observer,
        start=place.estimate.start,
        sensor=place.sensor,
        control_period=place.period,
        mse_h=h,
        mse_theta=theta,
        iae_h=_mean(stood["iae_h"])[0],
        iae_theta=_mean(stood["iae_theta"])[0],
        effort=_mean(stood["effort"])[0],
        total_variation=variation,
        peak_force=_mean(stood["peak_force"])[0],
        failures=int(failed.sum()),
        runs=cell.runs,
        late_variation=float(np.median(stood["late_variation"])) if not failed.all() else np.nan,
        outside=_said(place.outside),
        mse_h_low=h_low,
        mse_h_high=h_high,
        mse_theta_low=theta_low,
        mse_theta_high=theta_high,
        total_variation_low=least,
        total_variation_high=most,
        failures_low=float(failures.low),
        failures_high=float(failures.high),
    )


def _said(is_so: bool) -> str:
    return "yes" if is_so else "no"


def _mean(values: Array) -> tuple[float, float, float]:
    """The mean over runs and its 95 % interval, Student's."""
    if len(values) == 0:
        return np.nan, np.nan, np.nan
    mean = float(values.mean())
    if len(values) == 1:
        return mean, np.nan, np.nan
    if np.ptp(values) == 0.0:
        return mean, mean, mean
    low, high = stats.t.interval(0.95, len(values) - 1, mean, stats.sem(values))
    return mean, float(low), float(high)
