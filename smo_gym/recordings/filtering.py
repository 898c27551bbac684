"""An extended Kalman filter of a rig's model along a recording, with all that a smoother or a fit wants of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.linearised import process_noise, ratio
from ..kernels.matrices import Symmetric, congruent, plus, plus_square
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..typing import Array, Flags, State
from .rig import Recording, Rig

STEPS = 2
"""Runge-Kutta steps in a sampling period."""
START = (0.2, 2.0)
"""Standard deviations of the velocities that a filter begins with; they come from the first three samples."""
SETTLED = 6
"""Samples from which on innovations count."""
_NUDGE = 1e-6
_UPPER = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Where a covariance's entries are among the ten that are kept."""


@dataclass(frozen=True, slots=True)
class Filtered:
    """States and covariances at each sample, after its measurements and ahead of them."""

    x: Array
    """(samples, 4)."""
    ahead: Array
    P: Array
    """(samples, 4, 4)."""
    P_ahead: Array
    F: Array
    """What a small error becomes from the sample before, (samples, 4, 4)."""
    loss: float
    """Sum of -log of the innovations' densities, but for the constant."""
    innovations: int
    """How many there are in it."""


def filtered(rig: Rig, recording: Recording, skip: bool = True) -> Filtered:
    """Run the filter.

    Args:
        rig: its model and noise.
        recording: the run.
        skip: leaves out the second position where its sensor says nothing.
    """
    t, y, n = recording.t, recording.y, len(recording.t)
    seen = np.ones((n, 2), dtype=np.bool_)
    seen[:, 1] = ~(recording.fault & skip)
    x, ahead, P, P_ahead, F = (
        np.zeros((n, 4)),
        np.zeros((n, 4)),
        np.zeros((n, 10)),
        np.zeros((n, 10)),
        np.zeros((n, 16)),
    )
    second = min(2, n - 1)
    x[0] = [*y[0], *(y[second] - y[0]) / (t[second] - t[0])]
    P[0, [0, 4, 7, 9]] = np.square([*rig.noise, *START])
    numbers = np.repeat(np.array(rig.model.params), LANES)
    run: Any = _filter(rig.model.rhs, len(rig.model.params))
    loss = run(
        numbers, np.diff(t, prepend=0.0), y, recording.u, seen, *rig.noise, *rig.acceleration, x, ahead, P, P_ahead, F
    )
    P, P_ahead = (np.ascontiguousarray(each[:, _UPPER]) for each in (P, P_ahead))
    return Filtered(x, ahead, P, P_ahead, F.reshape(n, 4, 4), loss, int(seen[SETTLED:].sum()))


@for_each_model
def _filter(rhs: Rhs, params: Params) -> Any:
    @inlined
    def flow(x: State, u: float, h: float, p: Any) -> State:
        for _ in range(STEPS):
            x = rk4(rhs, x, (u,) + p, h / STEPS)  # noqa: RUF005  # Numba unpacks no tuple here
        return x

    @inlined
    def column(x: State, a: float, b: float, c: float, d: float, u: float, h: float, p: Any) -> State:
        """How the flow grows along (a, b, c, d), of length _NUDGE."""
        more = flow((x[0] + a, x[1] + b, x[2] + c, x[3] + d), u, h, p)
        less = flow((x[0] - a, x[1] - b, x[2] - c, x[3] - d), u, h, p)
        s = 0.5 / _NUDGE
        return s * (more[0] - less[0]), s * (more[1] - less[1]), s * (more[2] - less[2]), s * (more[3] - less[3])

    def run(
        rows: Array,
        h: Array,
        y: Array,
        u: Array,
        seen: Flags,
        noise_1: float,
        noise_2: float,
        q_1: float,
        q_2: float,
        x: Array,
        ahead: Array,
        P: Array,
        P_ahead: Array,
        F: Array,
    ) -> float:
        p = params(rows, 0, 0)
        z = (x[0, 0], x[0, 1], x[0, 2], x[0, 3])
        C = (P[0, 0], 0.0, 0.0, 0.0, P[0, 4], 0.0, 0.0, P[0, 7], 0.0, P[0, 9])
        loss = 0.0
        for k in range(1, len(h)):
            a = column(z, _NUDGE, 0.0, 0.0, 0.0, u[k - 1], h[k], p)
            b = column(z, 0.0, _NUDGE, 0.0, 0.0, u[k - 1], h[k], p)
            c = column(z, 0.0, 0.0, _NUDGE, 0.0, u[k - 1], h[k], p)
            d = column(z, 0.0, 0.0, 0.0, _NUDGE, u[k - 1], h[k], p)
            z = flow(z, u[k - 1], h[k], p)
            across = (
                (a[0], b[0], c[0], d[0]),
                (a[1], b[1], c[1], d[1]),
                (a[2], b[2], c[2], d[2]),
                (a[3], b[3], c[3], d[3]),
            )
            noise = process_noise((q_1 * q_1, q_2 * q_2), ratio(rhs, z, u[k - 1], p), h[k])
            C = plus(congruent(across, C), noise)
            for i in range(4):
                ahead[k, i] = z[i]
                F[k, 4 * i], F[k, 4 * i + 1], F[k, 4 * i + 2], F[k, 4 * i + 3] = a[i], b[i], c[i], d[i]
            for i in range(10):
                P_ahead[k, i] = C[i]
            if seen[k, 0]:
                z, C, cost = _told(z, C, (C[0], C[1], C[2], C[3]), y[k, 0] - z[0], C[0] + noise_1 * noise_1)
                loss += cost if k >= SETTLED else 0.0
            if seen[k, 1]:
                z, C, cost = _told(z, C, (C[1], C[4], C[5], C[6]), y[k, 1] - z[1], C[4] + noise_2 * noise_2)
                loss += cost if k >= SETTLED else 0.0
            for i in range(4):
                x[k, i] = z[i]
            for i in range(10):
                P[k, i] = C[i]
        return loss

    return run


@inlined
def _told(x: State, P: Symmetric, row: State, e: float, variance: float) -> tuple[State, Symmetric, float]:
    """State and covariance after an innovation e, and -log of its density; ``row`` is that of P which was measured."""
    g = e / variance
    x = (x[0] + g * row[0], x[1] + g * row[1], x[2] + g * row[2], x[3] + g * row[3])
    return x, plus_square(P, -1.0 / variance, row), 0.5 * (np.log(variance) + e * g)
