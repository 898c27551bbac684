"""Metrics of closed-loop runs, summed up as a run goes on: memory does not grow with its length.

A :class:`Meter` is a part of the loop and what its rows mean in the end. Ours is :data:`USUAL`; :func:`register` adds
others, whose metrics then stand in every table of runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.blocks import ALIVE, XD, XHAT, Block, U, X, at, block, four, offsets
from ..loop import ROLES, Part, columns
from ..plant import STATE_NAMES
from ..typing import Array


@dataclass(frozen=True, slots=True)
class Metric:
    """A number that each run gives: its name, unit and description."""

    name: str
    unit: str
    label: str


@dataclass(frozen=True, slots=True)
class Meter:
    """Some metrics and how they come about.

    Args:
        name: of the part in the loop.
        metrics: what it measures.
        rows: how many rows of its own it has, 0 at the start.
        finish: from its rows (rows, n) and the control period in s to one row a metric, (metrics, n).
        sample: block that is called at every sampling instant.
        close: block that is called when a control period ends. Both must leave runs alone whose row ALIVE is 0.

    At a sampling instant a meter may read positions and their references, rows X, X + 1, XD and XD + 1, and the force;
    at the end of a control period the whole state, the estimate, the force and the reward. Where an agent is asked once
    a control period, nothing else is known at those instants.
    """

    name: str
    metrics: tuple[Metric, ...]
    rows: int
    finish: Callable[[Array, float], Array]
    sample: Block | None = None
    close: Block | None = None

    def part(self, n: int) -> Part:
        """What the meter puts into a loop of n slots."""
        return Part(columns(n, np.zeros(self.rows)), sample=self.sample, close=self.close)


(
    SQUARES,
    ERRORS,
    EFFORT,
    VARIATION,
    PEAKS,
    PEAK_FORCE,
    PEAK_SPEEDS,
    PEAK_ESTIMATES,
    PREVIOUS,
    SAMPLES,
    PERIODS,
    _ROWS,
) = offsets(2, 4, 1, 1, 2, 1, 2, 3, 1, 1, 1)


@inlined
def add(own: Array, row: int, i: int, value: float, going: bool) -> None:
    """Add to a row, in runs that go on."""
    own[row * LANES + i] += value if going else 0.0


@inlined
def peak(own: Array, row: int, i: int, value: float, going: bool) -> None:
    """Keep the largest magnitude, in runs that go on."""
    size, before = abs(value), own[row * LANES + i]
    own[row * LANES + i] = size if going and size > before else before


@inlined
def peak_or_nan(own: Array, row: int, i: int, value: float, going: bool) -> None:
    """Keep the largest magnitude, in runs that go on, and NaN once there was one."""
    size, before = abs(value), own[row * LANES + i]
    own[row * LANES + i] = size if going and not (size <= before) else before


@block
def _sample(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going = at(signals, ALIVE, i) > 0.0
        h, theta = at(signals, X, i) - at(signals, XD, i), at(signals, X + 1, i) - at(signals, XD + 1, i)
        add(own, SQUARES, i, h * h, going)
        add(own, SQUARES + 1, i, theta * theta, going)
        add(own, SAMPLES, i, 1.0, going)
        peak(own, PEAKS, i, h, going)
        peak(own, PEAKS + 1, i, theta, going)


@block
def _close(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going, u = at(signals, ALIVE, i) > 0.0, at(signals, U, i)
        x, xhat = four(signals, X, i), four(signals, XHAT, i)
        before = at(own, PREVIOUS, i)
        add(own, EFFORT, i, u * u, going)
        add(own, VARIATION, i, abs(u - before), going)
        own[PREVIOUS * LANES + i] = u if going else before
        add(own, PERIODS, i, 1.0, going)
        peak(own, PEAK_FORCE, i, u, going)
        e0, e1, e2, e3 = xhat[0] - x[0], xhat[1] - x[1], xhat[2] - x[2], xhat[3] - x[3]
        add(own, ERRORS, i, e0 * e0, going)
        add(own, ERRORS + 1, i, e1 * e1, going)
        add(own, ERRORS + 2, i, e2 * e2, going)
        add(own, ERRORS + 3, i, e3 * e3, going)
        peak(own, PEAK_SPEEDS, i, x[2], going)
        peak(own, PEAK_SPEEDS + 1, i, x[3], going)
        peak_or_nan(own, PEAK_ESTIMATES, i, xhat[1], going)
        peak_or_nan(own, PEAK_ESTIMATES + 1, i, xhat[2], going)
        peak_or_nan(own, PEAK_ESTIMATES + 2, i, xhat[3], going)


def _finish(rows: Array, control_period: float) -> Array:
    periods = rows[PERIODS]
    return np.array(
        [
            *(rows[SQUARES:ERRORS] / rows[SAMPLES]),
            *np.sqrt(rows[ERRORS:EFFORT] / periods),
            rows[EFFORT] * control_period,
            *rows[VARIATION:PREVIOUS],
            periods * control_period,
        ]
    )


_UNITS = ("m", "rad", "m/s", "rad/s")

USUAL = Meter(
    "metrics",
    (
        Metric("mse_h", "m^2", "mean of (h - h_d)^2 over the sampling instants; h_d = 0 without a reference"),
        Metric("mse_theta", "rad^2", "the same of theta"),
        *(
            Metric(f"estimation_rms_{name}", unit, f"RMS of {name}'s estimate less {name} over the control instants")
            for name, unit in zip(STATE_NAMES, _UNITS, strict=True)
        ),
        Metric("effort", "N^2 s", "integral of u^2"),
        Metric("total_variation", "N", "sum of |u_k - u_{k-1}|, from u = 0"),
        Metric("peak_h", "m", "largest |h - h_d| at a sampling instant"),
        Metric("peak_theta", "rad", "largest |theta - theta_d| at a sampling instant"),
        Metric("peak_force", "N", "largest |u|"),
        Metric("peak_h_dot", "m/s", "largest |h'| at a control instant"),
        Metric("peak_theta_dot", "rad/s", "largest |theta'| at a control instant"),
        *(
            Metric(f"peak_estimate_{name}", unit, f"largest magnitude of {name}'s estimate at a control instant")
            for name, unit in zip(STATE_NAMES[1:], _UNITS[1:], strict=True)
        ),
        Metric("duration", "s", "until the horizon or the failure"),
    ),
    _ROWS,
    _finish,
    _sample,
    _close,
)
"""The metrics of the article's tables and of the diagnostics; those of an estimate are NaN without observer."""

METERS: dict[str, Meter] = {USUAL.name: USUAL}


def register(meter: Meter) -> None:
    """Add a meter, whose metrics are measured from now on.

    Raises:
        ValueError: its name or that of a metric is taken.
    """
    if meter.name in (*ROLES, "forces"):
        raise ValueError(f"a meter cannot be named {meter.name!r}: a part of every loop is")
    if meter.name in METERS:
        raise ValueError(f"a meter {meter.name!r} is registered already")
    if taken := {metric.name for metric in meter.metrics} & {*names()}:
        raise ValueError(f"metrics {', '.join(sorted(taken))} are measured already")
    METERS[meter.name] = meter


@contextmanager
def measuring(meters: Iterable[Meter]) -> Iterator[None]:
    """While it lasts, these are measured, too."""
    added = [meter for meter in meters if meter.name not in METERS]
    for meter in added:
        register(meter)
    try:
        yield
    finally:
        for meter in added:
            del METERS[meter.name]


def names() -> list[str]:
    """All metrics' names, in the order of the tables."""
    return [metric.name for meter in METERS.values() for metric in meter.metrics]


def registered() -> list[Metric]:
    """The metrics that others have added."""
    return [metric for meter in METERS.values() if meter is not USUAL for metric in meter.metrics]
