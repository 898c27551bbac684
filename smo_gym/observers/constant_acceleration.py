"""A Kalman filter without a model of the plant: each position's acceleration wanders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Y, at, block, four, offsets, put_four, put_two, two
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import positive_pair
from .estimator import Compiling

PERIOD, JERK, VARIANCE, ACCELERATIONS, FIRST, SECOND, _ = offsets(1, 2, 2, 2, 6, 6)
Third = tuple[float, float, float, float, float, float]
"""A covariance of three: the rows of the upper triangle one after the other."""


@inlined
def _three(rows: Array, row: int, i: int) -> Third:
    return (
        rows[row * LANES + i],
        rows[(row + 1) * LANES + i],
        rows[(row + 2) * LANES + i],
        rows[(row + 3) * LANES + i],
        rows[(row + 4) * LANES + i],
        rows[(row + 5) * LANES + i],
    )


@inlined
def _put_three(rows: Array, row: int, i: int, P: Third) -> None:
    rows[row * LANES + i] = P[0]
    rows[(row + 1) * LANES + i] = P[1]
    rows[(row + 2) * LANES + i] = P[2]
    rows[(row + 3) * LANES + i] = P[3]
    rows[(row + 4) * LANES + i] = P[4]
    rows[(row + 5) * LANES + i] = P[5]


@inlined
def _filtered(
    q: float, v: float, a: float, P: Third, y: float, h: float, jerk: float, variance: float
) -> tuple[float, float, float, Third]:
    """One channel's prediction over h and its correction with y."""
    s = 0.5 * h * h
    r0 = P[0] + h * P[1] + s * P[2], P[1] + h * P[3] + s * P[4], P[2] + h * P[4] + s * P[5]
    r1, r2 = P[3] + h * P[4], P[4] + h * P[5]
    a00, a01, a02 = r0[0] + h * r0[1] + s * r0[2], r0[1] + h * r0[2], r0[2]
    a11, a12, a22 = r1 + h * r2, r2, P[5]
    h2 = h * h
    a00, a01, a02 = a00 + jerk * h2 * h2 * h / 20.0, a01 + jerk * h2 * h2 / 8.0, a02 + jerk * h2 * h / 6.0
    a11, a12, a22 = a11 + jerk * h2 * h / 3.0, a12 + jerk * h2 / 2.0, a22 + jerk * h
    q, v = q + h * v + s * a, v + h * a
    e, w = y - q, 1.0 / (a00 + variance)
    k = w * a00, w * a01, w * a02
    left = a00 - k[0] * a00, a01 - k[0] * a01, a02 - k[0] * a02, a11 - k[1] * a01, a12 - k[1] * a02, a22 - k[2] * a02
    return q + k[0] * e, v + k[1] * e, a + k[2] * e, left


@block
def _filter(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        (q, theta, v, omega), y, h = four(signals, XHAT, i), two(signals, Y, i), at(own, PERIOD, i)
        a, jerk, variance = two(own, ACCELERATIONS, i), two(own, JERK, i), two(own, VARIANCE, i)
        q, v, first, P = _filtered(q, v, a[0], _three(own, FIRST, i), y[0], h, jerk[0], variance[0])
        theta, omega, second, R = _filtered(theta, omega, a[1], _three(own, SECOND, i), y[1], h, jerk[1], variance[1])
        put_four(signals, XHAT, i, (q, theta, v, omega))
        put_two(own, ACCELERATIONS, i, (first, second))
        _put_three(own, FIRST, i, P)
        _put_three(own, SECOND, i, R)


@dataclass(frozen=True, slots=True)
class ConstantAcceleration(Compiling):
    """Kalman's filter of [q, q', q''] for each position, with q''' white noise and white noise on the samples.

    Known as the Wiener-process acceleration model: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
    Tracking and Navigation (2001), section 6.2.3.

    Args:
        jerk: square roots of the power spectral densities of q''', m/s^3/sqrt(Hz) and rad/s^3/sqrt(Hz).
        noise: standard deviations of the measured positions in m and rad.
        velocity: standard deviations of the initial velocities, which are taken to be 0.
        acceleration: the same of the accelerations.

    Raises:
        ValueError: a value is not positive.
    """

    jerk: tuple[float, float] = (20.0, 100.0)
    noise: tuple[float, float] = (3e-5, 4.5e-4)
    velocity: tuple[float, float] = (1.0, 3.0)
    acceleration: tuple[float, float] = (5.0, 30.0)

    def __post_init__(self) -> None:
        for name in ("jerk", "noise", "velocity", "acceleration"):
            object.__setattr__(self, name, positive_pair(name, getattr(self, name)))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any plant and force will do."""
        variance, speed, pull = np.square(self.noise), np.square(self.velocity), np.square(self.acceleration)
        begun = [[variance[c], 0.0, 0.0, speed[c], 0.0, pull[c]] for c in (0, 1)]
        return Part(columns(n, dt, np.square(self.jerk), variance, (0.0, 0.0), *begun), sample=_filter, period=PERIOD)
