"""References for the velocities of a recording, which nobody measured: smoothers with a model and without."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_filter

from ..kernels import kernel
from ..typing import Array
from .filtering import filtered
from .rig import Recording, Rig

MODEL, JERK, POLYNOMIAL = "model", "constant-jerk", "savitzky-golay"
REFERENCES = (MODEL, JERK, POLYNOMIAL)


def references(rig: Rig, recordings: Sequence[Recording]) -> dict[str, list[Array]]:
    """Velocities by reference, for each recording (samples, 2)."""
    return {
        MODEL: [smoothed(rig, each)[0][:, 2:] for each in recordings],
        JERK: [constant_jerk(rig, each) for each in recordings],
        POLYNOMIAL: [polynomial(rig, each) for each in recordings],
    }


def smoothed(
    rig: Rig, recording: Recording, params: Sequence[float] | None = None, skip: bool = True
) -> tuple[Array, Array, float]:
    """States, their standard deviations and the sum of -log of the innovations' densities: an extended RTS smoother.

    Rauch, Tung and Striebel (AIAA Journal 3, 1965) on the linearisation along an extended Kalman filter. The deviations
    are those that model and noise say; what the model gets wrong is not in them.

    Args:
        rig: its model and noise.
        recording: the run.
        params: of the model, in place of the rig's.
        skip: leaves out the second position where its sensor says nothing.

    Returns:
        (samples, 4), (samples, 4), and the sum over measurements after the fifth sample.
    """
    along = filtered(rig if params is None else rig.of(params), recording, skip)
    _backward(along.x, along.ahead, along.P, along.P_ahead, along.F)
    return along.x, np.sqrt(np.diagonal(along.P, axis1=1, axis2=2)), along.loss


def _backward(x: Array, ahead: Array, P: Array, P_ahead: Array, F: Array) -> None:
    """Make of filtered states and covariances smoothed ones, in place."""
    gains = np.linalg.solve(P_ahead[1:], F[1:] @ P[:-1]).transpose(0, 2, 1)
    for k in range(len(x) - 2, -1, -1):
        x[k] += gains[k] @ (x[k + 1] - ahead[k + 1])
        P[k] += gains[k] @ (P[k + 1] - P_ahead[k + 1]) @ gains[k].T


def constant_jerk(rig: Rig, recording: Recording) -> Array:
    """Velocities (samples, 2) of an RTS smoother of [q, q', q''] driven by white jerk, without any model."""
    found = np.empty((len(recording.t), 2))
    h = np.diff(recording.t, prepend=recording.t[0] - rig.period)
    for c, (jerk, noise) in enumerate(zip(rig.jerk, rig.noise, strict=True)):
        x, *others = _jerk(h, recording.y[:, c], jerk, noise)
        _backward(x, *others)
        found[:, c] = x[:, 1]
    return found


@kernel
def _jerk(h: Array, y: Array, jerk: float, noise: float) -> tuple[Array, Array, Array, Array, Array]:
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
    return x, ahead, P, P_ahead, F


def polynomial(rig: Rig, recording: Recording) -> Array:
    """Velocities (samples, 2) of polynomials through neighbouring samples (Savitzky-Golay), without any model.

    A sample that is missing is put on the line between its neighbours.
    """
    period = float(np.median(np.diff(recording.t)))
    steps = np.round(recording.t / period).astype(int)
    grid = np.arange(steps[-1] + 1)
    y = np.column_stack([np.interp(grid, steps, each) for each in recording.y.T])
    return np.asarray(savgol_filter(y, *rig.window, deriv=1, delta=period, axis=0)[steps])
