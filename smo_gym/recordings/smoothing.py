"""References for the velocities of a recording, which nobody measured: smoothers with a model and without."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from ..kernels import kernel
from ..kernels.modelling import Rhs
from ..kernels.rk4 import rk4
from ..typing import Array
from .rig import Recording, Rig

STEPS = 2
"""Runge-Kutta steps in a sampling period."""
_NUDGE = 1e-6
START = (0.2, 2.0)
"""Standard deviations of the velocities that a smoother begins with; they come from the first three samples."""
MODEL, JERK, POLYNOMIAL = "model", "constant-jerk", "savitzky-golay"
REFERENCES = (MODEL, JERK, POLYNOMIAL)


def references(rig: Rig, recordings: Sequence[Recording]) -> dict[str, list[Array]]:
    """Velocities by reference, for each recording (samples, 2)."""
    return {
        MODEL: [smoothed(rig, each)[0][:, 2:] for each in recordings],
        JERK: [constant_jerk(rig, each) for each in recordings],
        POLYNOMIAL: [
            np.asarray(savgol_filter(each.y, *rig.window, deriv=1, delta=rig.period, axis=0)) for each in recordings
        ],
    }


def smoothed(
    rig: Rig, recording: Recording, params: Sequence[float] | None = None, skip: bool = True
) -> tuple[Array, Array, float]:
    """States, their standard deviations and the sum of -log of the innovations' densities: an extended RTS smoother.

    Rauch, Tung and Striebel (AIAA Journal 3, 1965) on the linearisation along an extended Kalman filter.

    Args:
        rig: its model and noise.
        recording: the run.
        params: of the model, in place of the rig's.
        skip: leaves out the second position where its sensor says nothing.

    Returns:
        (samples, 4), (samples, 4), and the sum over measurements after the fifth sample.
    """
    h = np.diff(recording.t, prepend=recording.t[0] - rig.period)
    y, first = recording.y, np.zeros(4)
    first[:2] = y[0]
    first[2:] = (y[min(2, len(y) - 1)] - y[0]) / (recording.t[min(2, len(y) - 1)] - recording.t[0])
    numbers = tuple(rig.model.params if params is None else params)
    fault = recording.fault & skip
    noise, acceleration = np.array(rig.noise), np.array(rig.acceleration)
    run = _smoother(rig.model.rhs)
    x, deviations, total = run(h, y, recording.u, fault, first, np.array(START), noise, acceleration, numbers)
    return x, deviations, float(total)


@cache
def _smoother(rhs: Rhs) -> Callable[..., tuple[Array, Array, float]]:
    def flow(x: Array, u: float, h: float, params: Any) -> Array:
        state = (x[0], x[1], x[2], x[3])
        for _ in range(STEPS):
            state = rk4(rhs, state, (u,) + params, h / STEPS)  # noqa: RUF005  # Numba unpacks no tuple here
        return np.array(state)

    flow = kernel(flow)

    def along_input(x: Array, u: float, params: Any) -> float:
        """How much of an acceleration along the input goes to the second velocity."""
        state = (x[0], x[1], x[2], x[3])
        a, b = rhs(state, 0.0, (u + 1.0,) + params), rhs(state, 0.0, (u - 1.0,) + params)  # noqa: RUF005
        return (a[3] - b[3]) / (a[2] - b[2])

    along_input = kernel(along_input)

    def smooth(
        h: Array, y: Array, u: Array, fault: Any, first: Array, start: Array, noise: Array, q: Array, params: Any
    ) -> tuple[Array, Array, float]:
        n = len(h)
        x, ahead = np.empty((n, 4)), np.empty((n, 4))
        P, P_ahead, F = np.empty((n, 4, 4)), np.empty((n, 4, 4)), np.empty((n, 4, 4))
        x[0] = first
        P[0] = np.diag(np.concatenate((noise**2, start**2)))
        total = 0.0
        for k in range(1, n):
            ahead[k] = flow(x[k - 1], u[k - 1], h[k], params)
            for j in range(4):
                nudge = np.zeros(4)
                nudge[j] = _NUDGE
                more = flow(x[k - 1] + nudge, u[k - 1], h[k], params)
                less = flow(x[k - 1] - nudge, u[k - 1], h[k], params)
                F[k, :, j] = (more - less) / (2.0 * _NUDGE)
            r = along_input(ahead[k], u[k - 1], params)
            power = np.zeros((2, 2))
            power[0, 0] = q[0] ** 2
            power[0, 1] = power[1, 0] = r * q[0] ** 2
            power[1, 1] = q[1] ** 2 + (r * q[0]) ** 2
            C = F[k] @ P[k - 1] @ F[k].T
            C[:2, :2] += power * h[k] ** 3 / 3.0
            C[:2, 2:] += power * h[k] ** 2 / 2.0
            C[2:, :2] += power * h[k] ** 2 / 2.0
            C[2:, 2:] += power * h[k]
            P_ahead[k] = C
            z = ahead[k].copy()
            for c in range(2):
                if c == 1 and fault[k]:
                    continue
                variance = C[c, c] + noise[c] ** 2
                e = y[k, c] - z[c]
                if k > 5:
                    total += 0.5 * (np.log(variance) + e * e / variance)
                gain = C[:, c] / variance
                z = z + gain * e
                C = C - np.outer(gain, C[c])
            x[k], P[k] = z, 0.5 * (C + C.T)
        for k in range(n - 2, -1, -1):
            gain = P[k] @ F[k + 1].T @ np.linalg.inv(P_ahead[k + 1])
            x[k] += gain @ (x[k + 1] - ahead[k + 1])
            P[k] += gain @ (P[k + 1] - P_ahead[k + 1]) @ gain.T
        deviations = np.empty((n, 4))
        for k in range(n):
            deviations[k] = np.sqrt(np.diag(P[k]))
        return x, deviations, total

    return kernel(smooth)


def constant_jerk(rig: Rig, recording: Recording) -> Array:
    """Velocities (samples, 2) of an RTS smoother of [q, q', q''] driven by white jerk, without any model."""
    found = np.empty((len(recording.t), 2))
    h = np.diff(recording.t, prepend=recording.t[0] - rig.period)
    for c, (jerk, noise) in enumerate(zip(rig.jerk, rig.noise, strict=True)):
        found[:, c] = _jerk(h, recording.y[:, c], jerk, noise)
    return found


@kernel
def _jerk(h: Array, y: Array, jerk: float, noise: float) -> Array:
    n = len(h)
    x, ahead = np.zeros((n, 3)), np.zeros((n, 3))
    P, P_ahead, F = np.zeros((n, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    x[0, 0] = y[0]
    P[0] = np.diag(np.array([noise * noise, 25.0, 1e3]))
    for k in range(1, n):
        d = h[k]
        F[k] = np.array([[1.0, d, 0.5 * d * d], [0.0, 1.0, d], [0.0, 0.0, 1.0]])
        push = np.array([d * d * d / 6.0, 0.5 * d * d, d])
        ahead[k] = F[k] @ x[k - 1]
        C = F[k] @ P[k - 1] @ F[k].T + np.outer(push, push) * (jerk * jerk / d)
        P_ahead[k] = C
        gain = C[:, 0] / (C[0, 0] + noise * noise)
        x[k] = ahead[k] + gain * (y[k] - ahead[k, 0])
        P[k] = C - np.outer(gain, C[0])
    for k in range(n - 2, -1, -1):
        gain = P[k] @ F[k + 1].T @ np.linalg.inv(P_ahead[k + 1])
        x[k] += gain @ (x[k + 1] - ahead[k + 1])
    return x[:, 1].copy()
