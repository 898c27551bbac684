"""What tuning minimises: the RMS errors of both velocities, each in units of its scale, in sum, on training runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from ..recordings import scoring, smoothing
from ..typing import Array
from . import observing, velocity_errors
from .candidates import Candidate, Tree
from .on_recordings import Runs
from .open_loop import Trajectories

SENSORS = ("counts", "noise")
"""Simulated observers are tuned behind these, on plants that no table has."""
LEVEL, RUNS, SEED = 0.2, 16, 10_000

Objective = Callable[[Tree], float]


def simulated(candidate: Candidate, scales: tuple[float, float]) -> Objective:
    """Of a candidate on simulated encoders."""

    def cost(tuned: Tree) -> float:
        observer = candidate.build(tuned=tuned)
        total = 0.0
        for seen in _training():
            with np.errstate(over="ignore", invalid="ignore"):
                found = velocity_errors.errors(seen.estimated(observer), seen.x, seen.dt)
                total += weighed(np.sqrt((found.rmse**2).mean(1)), scales)
        return total

    return cost


def on_runs(candidate: Candidate, runs: Runs, scales: tuple[float, float]) -> Objective:
    """Of a candidate on a rig's recordings, against the smoother with the model."""
    reference = runs.references[smoothing.MODEL]
    masks = [scoring.scored(runs.rig, each) for each in runs.recordings]

    def cost(tuned: Tree) -> float:
        found = runs.velocities(candidate.build(runs.rig.model, tuned))
        with np.errstate(over="ignore", invalid="ignore"):
            e = np.concatenate([(v - w)[mask] for v, w, mask in zip(found, reference, masks, strict=True)])
            return weighed(np.sqrt((e**2).mean(0)), scales)

    return cost


def weighed(rmse: Array, scales: Any) -> float:
    """RMS errors in units of their scales, in sum."""
    return float((rmse / np.array(scales)).sum())


@cache
def _training() -> list[Trajectories]:
    return [observing.simulated(sensor, LEVEL, RUNS, SEED) for sensor in SENSORS]
