"""The unscented Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Block, U, Y, at, four, offsets, put_four, two
from ..kernels.linearised import halfway, process_noise, ratio
from ..kernels.matrices import cholesky, corrected, diagonal, plus, plus_square, put_symmetric, symmetric
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import along, rk4, steps_of
from ..loop import Part, columns
from ..models import Model, known
from ..plant import CartPendulum
from ..typing import Array
from ..validation import number, positive_pair, whole
from .estimator import Compiling


@dataclass(frozen=True, slots=True)
class UnscentedKalmanFilter(Compiling):
    """Estimates the state as :class:`~smo_gym.observers.kalman.ExtendedKalmanFilter` does, with points for a Jacobian.

    Mean and covariance are predicted by what the model makes of xhat and of eight points around it, xhat +- the columns
    of sqrt(c) L with L L' = P and c = alpha^2 (4 + kappa). With d_i the distances of the points' images from that of
    xhat, and m their mean sum d_i / (2 c), the scaled transform comes to::

        xhat <- RK4(xhat) + m,    P <- sum d_i d_i' / (2 c) + (beta - alpha^2) m m' + Q

    which loses no digits where alpha is small. Measured are positions: they correct as in a linear filter. Julier and
    Uhlmann, Proceedings of the IEEE 92 (2004); the points are van der Merwe's (thesis, OGI 2004).

    Args:
        acceleration: square roots of the power spectral densities of both accelerations' noise, in m/s^2/sqrt(Hz) and
            rad/s^2/sqrt(Hz), which enters as in the extended filter.
        noise: standard deviations of the measured positions in m and rad.
        velocity: standard deviations of the initial velocities, which are taken to be 0, in m/s and rad/s.
        alpha: how far out the points are, in units of sqrt(4 + kappa) standard deviations. 1 is far enough to see how
            the model bends, and with ``beta`` of at least alpha^2 no covariance can become indefinite.
        beta: 2 is best for a normal distribution.
        kappa: above -4; 0 with alpha = 1 and beta = 1 is the cubature Kalman filter.
        substeps: integration steps in a sampling period, points drawn anew for each.
        model: nominal plant; None for the one that the environment draws its plants around.

    Raises:
        ValueError: a value is not allowed.
    """

    acceleration: tuple[float, float] = (0.5, 2.0)
    noise: tuple[float, float] = (3e-5, 4.5e-4)
    velocity: tuple[float, float] = (1.0, 3.0)
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    substeps: int = 1
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        for name in ("acceleration", "noise", "velocity"):
            object.__setattr__(self, name, positive_pair(name, getattr(self, name)))
        object.__setattr__(self, "alpha", number("alpha", self.alpha, above=0.0))
        object.__setattr__(self, "beta", number("beta", self.beta))
        object.__setattr__(self, "kappa", number("kappa", self.kappa, above=-4.0))
        if self.beta < self.alpha**2:
            raise ValueError(f"beta={self.beta!r} must be at least alpha^2={self.alpha**2:g}: a covariance is positive")
        object.__setattr__(self, "substeps", whole("substeps", self.substeps, 1))
        object.__setattr__(self, "model", known(self.model))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the filter puts into a loop of n slots."""
        model = Model.of(self.model or nominal)
        step, variance = dt / self.substeps, np.square(self.noise)
        covariance = diagonal(*variance, *np.square(self.velocity))
        spread, excess = self.alpha**2 * (4.0 + self.kappa), self.beta - self.alpha**2
        settings = np.square(self.acceleration), variance, spread, excess
        return Part(
            columns(n, dt, step, covariance, *settings, np.zeros(34), model.params),
            sample=_filter(model.rhs, len(model.params)),
            alike=(dt, step),
            period=PERIOD,
        )


PERIOD, STEP, COVARIANCE, DENSITY, VARIANCE, SPREAD, EXCESS, *WORK, MODEL = offsets(1, 1, 10, 2, 2, 1, 1, *[4] * 6, 10)
FIRST, SECOND, THIRD, FOURTH, CENTRE, MEAN, SQUARES = WORK


@for_each_model
def _filter(rhs: Rhs, params: Params) -> Block:
    def estimate(signals: Array, own: Array, lanes: int) -> None:
        steps, h = steps_of(own[PERIOD * LANES], own[STEP * LANES])
        for _ in range(steps):
            for i in range(lanes):
                x, inputs = four(signals, XHAT, i), (at(signals, U, i),) + params(own, MODEL, i)  # noqa: RUF005
                a, b, c, d = cholesky(symmetric(own, COVARIANCE, i), at(own, SPREAD, i))
                put_four(own, FIRST, i, a)
                put_four(own, SECOND, i, b)
                put_four(own, THIRD, i, c)
                put_four(own, FOURTH, i, d)
                put_four(own, CENTRE, i, rk4(rhs, x, inputs, h))
                put_four(own, MEAN, i, (0.0, 0.0, 0.0, 0.0))
                put_symmetric(own, SQUARES, i, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
            for _ in range(4):
                for i in range(lanes):
                    x, inputs = four(signals, XHAT, i), (at(signals, U, i),) + params(own, MODEL, i)  # noqa: RUF005
                    s, centre, m = four(own, FIRST, i), four(own, CENTRE, i), four(own, MEAN, i)
                    w = 0.5 / at(own, SPREAD, i)
                    a = along(rk4(rhs, along(x, 1.0, s), inputs, h), -1.0, centre)
                    b = along(rk4(rhs, along(x, -1.0, s), inputs, h), -1.0, centre)
                    put_four(own, MEAN, i, along(along(m, w, a), w, b))
                    put_symmetric(own, SQUARES, i, plus_square(plus_square(symmetric(own, SQUARES, i), w, a), w, b))
                    # the next column takes the place of the one that is done: each row has a constant place
                    put_four(own, FIRST, i, four(own, SECOND, i))
                    put_four(own, SECOND, i, four(own, THIRD, i))
                    put_four(own, THIRD, i, four(own, FOURTH, i))
            for i in range(lanes):
                x, u, p = four(signals, XHAT, i), at(signals, U, i), params(own, MODEL, i)
                m = four(own, MEAN, i)
                new = along(four(own, CENTRE, i), 1.0, m)
                P = plus_square(symmetric(own, SQUARES, i), at(own, EXCESS, i), m)
                Q = process_noise(two(own, DENSITY, i), ratio(rhs, halfway(x, new), u, p), h)
                put_four(signals, XHAT, i, new)
                put_symmetric(own, COVARIANCE, i, plus(P, Q))
        for i in range(lanes):
            x, P = four(signals, XHAT, i), symmetric(own, COVARIANCE, i)
            y, r = two(signals, Y, i), two(own, VARIANCE, i)
            x, P = corrected(x, P, (P[0], P[1], P[2], P[3]), y[0] - x[0], P[0] + r[0])
            x, P = corrected(x, P, (P[1], P[4], P[5], P[6]), y[1] - x[1], P[4] + r[1])
            put_four(signals, XHAT, i, x)
            put_symmetric(own, COVARIANCE, i, P)

    return estimate
