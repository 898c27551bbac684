"""How soon the designed observer has converged, over margin, integration step and noise."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..controllers import LQR
from ..observers import Gains, SlidingModeObserver
from ..theorem import OperatingSet, design, reaching_time, stable, suprema, velocity_bound
from ..typing import Array
from .open_loop import Trajectories, trajectories

MARGINS = (0.03, 0.1, 0.3, 1.0, 3.0)
"""By how much all gains exceed their suprema."""
FINER = (1, 4)
"""Steps in the longest one that is stable."""
DESIGNS = [*itertools.product(MARGINS, FINER)]
NOISES: dict[str, dict[str, tuple[float, float]]] = {"none": {}, "1 mrad": {"noise": (2e-4, 1e-3)}}


@dataclass(frozen=True, slots=True)
class Row:
    """A design on runs that begin at the edge of the declared starts."""

    margin: float
    step: float
    """In s."""
    noise: str
    promised: float
    """Median over runs of the later of both t1 of (48), each from t0 of (43) and the velocity's error then."""
    converged: float
    """Median over runs of when both velocities' errors came below the bound for good, in s."""
    slowest: float
    """The largest of these; infinite where one never did."""
    bound: Array
    """What the errors of h' in m/s and theta' in rad/s come below without noise, (2,)."""
    largest: Array
    """The largest of each in the last second, over all runs, (2,)."""

    def said(self) -> tuple[str, ...]:
        """The row in words, below :data:`HEADER`."""
        pairs = (" ".join(f"{value:.2g}" for value in values) for values in (self.bound, self.largest))
        times = (f"{value:.3f}" if np.isfinite(value) else "never" for value in (self.converged, self.slowest))
        return f"{self.margin:.0%}", f"{1e3 * self.step:.3g}", self.noise, f"{self.promised:.3f}", *times, *pairs


HEADER = (
    "margin",
    "step, ms",
    "noise",
    "t1, s",
    "below bound, s",
    "slowest",
    "bound, h' theta'",
    "largest, last second",
)


def edge(low: Array, high: Array, runs: int, rng: np.random.Generator) -> Array:
    """Starts on the surface of a box, (runs, 4): each on a side of its own, uniformly."""
    starts = rng.uniform(low, high, (runs, 4))
    side, upper = rng.integers(4, size=runs), rng.integers(2, size=runs).astype(np.bool_)
    starts[np.arange(runs), side] = np.where(upper, high[side], low[side])
    return starts


def sweep(
    over: OperatingSet,
    slopes: tuple[float, float],
    force: float,
    law: LQR,
    starts: Array,
    seed: int,
    dt: float,
    horizon: float,
    told: Callable[[int], object] = lambda designs: None,
) -> Iterator[Row]:
    """Rows for all margins, steps and noises, on the same trajectories, which the law makes of the true state.

    Args:
        over: the operating set.
        slopes: of the designed observer.
        force: that steps are stable up to, in N.
        law: keeps the plants in the set.
        starts: x(0), (runs, 4).
        seed: of plants and noise.
        dt: sampling period in s.
        horizon: of the runs in s.
        told: called with the number of designs done since the last call.
    """
    options = {"control_period": dt, "dt": dt, "horizon": horizon, "force_limit": force, "track_limit": None}
    seen = {
        noise: trajectories(
            "SMOPendulum-v0", law, starts, over.uncertainty, len(starts), seed, **options, sensor=sensor
        )
        for noise, sensor in NOISES.items()
    }
    for margin, finer in DESIGNS:
        longest = stable(design(over, margin), slopes, dt, force)
        assert longest.step is not None
        observer = replace(longest, step=longest.step / finer)
        for noise, runs in seen.items():
            yield _row(margin, noise, observer, over, force, runs)
        told(1)


def _row(
    margin: float, noise: str, observer: SlidingModeObserver, over: OperatingSet, force: float, runs: Trajectories
) -> Row:
    bounds, bound = suprema(over), velocity_bound(observer, over, force)
    xhat = runs.estimated(observer)
    e = np.abs(runs.x - xhat)
    gains = Gains.of(observer.gains)
    m1, beta_1 = np.array(gains.m1)[:, None], np.array(gains.beta_1)[:, None]
    t0 = reaching_time(e[0, :2], m1, bounds.speed[:, None])
    at = np.minimum(np.ceil(t0 / runs.dt).astype(int), len(e) - 1)
    then = np.array([e[at[c], 2 + c, np.arange(e.shape[2])] for c in (0, 1)])
    t1 = t0 + reaching_time(then, beta_1, bounds.drift[:, None])
    outside = np.asarray((e[:, 2:] > bound[:, None]).any(1))
    last = len(e) - np.argmax(outside[::-1], axis=0)
    converged = np.where(outside.any(0), np.where(outside[-1], np.inf, runs.dt * last), 0.0)
    late = slice(len(e) - round(1.0 / runs.dt), None)
    assert observer.step is not None
    return Row(
        margin,
        observer.step,
        noise,
        float(np.median(t1.max(0))),
        float(np.median(converged)),
        float(converged.max()),
        bound,
        e[late, 2:].max((0, 2)),
    )
