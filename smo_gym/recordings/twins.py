"""A twin of a recording: what the rig's model, its noise and its sensors make of the same input. Its truth is known.

What a reference or an observer gets wrong can be told on a twin, except what the model itself gets wrong: there it is
right. Nothing holds the twin upright, so that a run that was balanced falls.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..kernels.batch import LANES
from ..kernels.linearised import ratio
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..typing import Array
from .rig import Recording, Rig
from .smoothing import smoothed

STEPS = 10
"""Runge-Kutta steps in the time between two samples, each with its own noise."""


def twin(rig: Rig, recording: Recording, seed: int) -> tuple[Recording, Array]:
    """A twin, which has no fault, and its true states, (samples, 4).

    Args:
        rig: its model, noise and steps of its sensors.
        recording: of the rig; its input, times and first state are the twin's.
        seed: of all noise.
    """
    rng = np.random.default_rng(seed)
    n, quanta, noise = len(recording.t), np.array(rig.quanta), np.array(rig.noise)
    x = np.empty((n, 4))
    x[0] = smoothed(rig, recording)[0][0]
    kicks = rng.normal(size=(n, STEPS, 2)) * rig.acceleration
    run: Any = _driven(rig.model.rhs, len(rig.model.params))
    run(np.repeat(np.array(rig.model.params), LANES), np.diff(recording.t, prepend=0.0), recording.u, kicks, x)
    beyond = np.sqrt(np.maximum(noise**2 - quanta**2 / 12.0, 0.0))
    y = quanta * np.round((x[:, :2] + beyond * rng.normal(size=(n, 2))) / quanta)
    return replace(recording, name=f"twin of {recording.name}", y=y, fault=np.zeros(n, dtype=np.bool_)), x


@for_each_model
def _driven(rhs: Rhs, params: Params) -> Any:
    def run(rows: Array, h: Array, u: Array, kicks: Array, x: Array) -> None:
        p = params(rows, 0, 0)
        z = (x[0, 0], x[0, 1], x[0, 2], x[0, 3])
        for k in range(1, len(h)):
            d, root = h[k] / STEPS, np.sqrt(h[k] / STEPS)
            for j in range(STEPS):
                z = rk4(rhs, z, (u[k - 1],) + p, d)  # noqa: RUF005  # Numba unpacks no tuple here
                first = root * kicks[k, j, 0]
                second = ratio(rhs, z, u[k - 1], p) * first + root * kicks[k, j, 1]
                z = (z[0], z[1], z[2] + first, z[3] + second)
            x[k, 0], x[k, 1], x[k, 2], x[k, 3] = z

    return run
