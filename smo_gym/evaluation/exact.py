"""Theorem 1 as it is proved, with the exact sgn: its implicit discretisation, at two steps on the same plants."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..observers import Gains, SlidingModeObserver
from ..theorem import OperatingSet, design, reaching_time, suprema
from ..typing import Array
from .open_loop import trajectories

STEPS = (1e-3, 2.5e-4)
"""In s."""


@dataclass(frozen=True, slots=True)
class Exact:
    """Errors of the designed observer with the set-valued sgn."""

    position: float
    """The largest of h in m and theta in rad after t0 of (43), over all runs."""
    order: Array
    """Order in the step of each run's largest velocity error after t1 of (48), (n,)."""
    shares: dict[str, Array]
    """RMS error of theta' after t1 as a share of theta', (n,), for X1's injection of (34) and of (26)."""


def exact(over: OperatingSet, margin: float, force: float, law: Any, starts: Array, seed: int, horizon: float) -> Exact:
    """Run it, on trajectories that the law makes of the true state.

    Args:
        over: the operating set.
        margin: of the designed gains.
        force: bound of the force in N.
        law: keeps the plants in the set.
        starts: x(0), (n, 4).
        seed: of the plants.
        horizon: of the runs in s.
    """
    gains = design(over, margin)
    observer = SlidingModeObserver(gains=gains, slopes=(math.inf, math.inf), scheme="implicit")
    largest, position = [], 0.0
    shares: dict[str, Array] = {}
    for dt in STEPS:
        options = {"control_period": dt, "dt": dt, "horizon": horizon, "force_limit": force, "track_limit": None}
        runs = trajectories("SMOPendulum-v0", law, starts, over.uncertainty, len(starts), seed, **options)
        e = np.abs(runs.x - runs.estimated(observer))
        t0, t1 = _times(e, gains, over, dt)
        position = max(position, float(e[math.ceil(t0 / dt) + 1 :, :2].max()))
        late = slice(math.ceil(t1 / dt) + 1, None)
        largest.append(e[late, 2:].max((0, 1)))
        for injection in ("34", "26"):
            found = runs.estimated(replace(observer, injection=injection))
            error, truth = (found - runs.x)[late, 3], runs.x[late, 3]
            shares[injection] = np.sqrt((error**2).mean(0) / (truth**2).mean(0))
    coarse, fine = largest
    return Exact(position, np.log(coarse / fine) / math.log(STEPS[0] / STEPS[1]), shares)


def _times(e: Array, gains: Gains, over: OperatingSet, dt: float) -> tuple[float, float]:
    """The latest t0 of (43) and t1 of (48) over all runs, in s."""
    bounds = suprema(over)
    t0 = float(reaching_time(e[0, :2], np.array(gains.m1)[:, None], bounds.speed[:, None]).max())
    then = e[min(math.ceil(t0 / dt) + 1, len(e) - 1), 2:]
    return t0, t0 + float(reaching_time(then, np.array(gains.beta_1)[:, None], bounds.drift[:, None]).max())
