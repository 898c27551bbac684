"""A copy of the plant, corrected with constant gains: by pole placement, or Kalman's in the long run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from ..kernels.blocks import XHAT, Block, U, Y, at, four, offsets, put_four, two
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import array, positive_pair
from .estimator import Compiling

C = np.eye(2, 4)
"""What is measured of a state."""
_NUDGE = 2.0**-17
PERIOD, USUAL, GAINS, MODEL = offsets(1, 1, 8)


@for_each_model
def _estimate(rhs: Rhs, params: Params) -> Block:
    def estimate(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            x, y, u, h = four(signals, XHAT, i), two(signals, Y, i), at(signals, U, i), at(own, PERIOD, i)
            new = rk4(rhs, x, (u,) + params(own, MODEL, i), h)  # noqa: RUF005  # Numba unpacks no tuple here
            e, f, share = y[0] - new[0], y[1] - new[1], at(own, USUAL, i) / h
            a, b = four(own, GAINS, i), four(own, GAINS + 4, i)
            put_four(
                signals,
                XHAT,
                i,
                (
                    new[0] + a[0] * e + b[0] * f,
                    new[1] + a[1] * e + b[1] * f,
                    new[2] + share * (a[2] * e + b[2] * f),
                    new[3] + share * (a[3] * e + b[3] * f),
                ),
            )

    return estimate


def linearised(model: Model, about: Array) -> tuple[Array, Array]:
    """A and B of the model near a state without input, (4, 4) and (4,), by central differences."""
    nudges = _NUDGE * np.eye(4)
    A = np.array([(model.rate(about + d, 0.0) - model.rate(about - d, 0.0)) / (2.0 * _NUDGE) for d in nudges]).T
    return A, (model.rate(about, _NUDGE) - model.rate(about, -_NUDGE)) / (2.0 * _NUDGE)


def discretised(A: Array, G: Array, dt: float) -> tuple[Array, Array]:
    """F = expm(A dt), and the covariance that white noise through G adds over dt (Van Loan, 1978)."""
    n = len(A)
    whole = expm(dt * np.block([[-A, G @ G.T], [np.zeros((n, n)), A.T]]))
    F = whole[n:, n:].T
    return F, F @ whole[:n, n:]


def _part(n: int, dt: float, K: Array, model: Model) -> Part:
    block = _estimate(model.rhs, len(model.params))
    return Part(columns(n, dt, dt, K.T.ravel(), model.params), sample=block, period=PERIOD)


@dataclass(frozen=True, slots=True)
class Luenberger(Compiling):
    """``xhat_k = x_new + K (y_k - C x_new)``, x_new from the model, K from the poles of its linearisation.

    Luenberger, An introduction to observers (IEEE Trans. Automatic Control 16, 1971). The errors' poles are
    exp(-rate dt), one rate a position and each twice (the second a little faster, since poles of higher multiplicity
    than there are outputs cannot be placed). After a gap the velocities' gains are those of the usual period, divided
    by how much longer it was.

    Args:
        rate: of both errors of each position, in 1/s.
        about: the state of the linearisation.
        model: of the plant; None for the nominal one.

    Raises:
        ValueError: a rate is not positive.
    """

    rate: tuple[float, float] = (60.0, 60.0)
    about: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", positive_pair("rate", self.rate))
        object.__setattr__(self, "about", tuple(array("about", self.about, (4,)).tolist()))

    def gains(self, model: Model, dt: float) -> Array:
        """K, (4, 2)."""
        from scipy.signal import place_poles  # brings much that nobody else needs

        F = expm(dt * linearised(model, np.array(self.about))[0])
        poles = np.exp(-dt * np.array([self.rate[0], 1.05 * self.rate[0], 1.1 * self.rate[1], 1.15 * self.rate[1]]))
        return np.asarray(place_poles(F.T, (C @ F).T, poles).gain_matrix.T)

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any force will do."""
        model = Model.of(self.model or nominal)
        return _part(n, dt, self.gains(model, dt), model)


@dataclass(frozen=True, slots=True)
class SteadyKalman(Compiling):
    """``xhat_k = x_new + K (y_k - C x_new)``, x_new from the model, K as Kalman's filter has it in the long run.

    Of the model's linearisation about a state, or, with ``about=None``, of two double integrators: their gain knows
    nothing of the plant and is right wherever its state is.

    Args:
        acceleration: square roots of the power spectral densities of both accelerations' noise, as of
            :class:`~smo_gym.observers.kalman.ExtendedKalmanFilter`.
        noise: standard deviations of the measured positions in m and rad.
        about: the state of the linearisation, or None.
        model: of the plant; None for the nominal one.

    Raises:
        ValueError: a value is not positive.
    """

    acceleration: tuple[float, float] = (0.5, 2.0)
    noise: tuple[float, float] = (3e-5, 4.5e-4)
    about: tuple[float, float, float, float] | None = None
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        for name in ("acceleration", "noise"):
            object.__setattr__(self, name, positive_pair(name, getattr(self, name)))
        if self.about is not None:
            object.__setattr__(self, "about", tuple(array("about", self.about, (4,)).tolist()))

    def gains(self, model: Model, dt: float) -> Array:
        """K, (4, 2)."""
        G = np.zeros((4, 2))
        G[2:] = np.diag(self.acceleration)
        A = np.eye(4, k=2)
        if self.about is not None:
            A, B = linearised(model, np.array(self.about))
            G[3, 0] = self.acceleration[0] * (B[3] / B[2] if B[2] else 0.0)
        F, Q = discretised(A, G, dt)
        R = np.diag(np.square(self.noise))
        P = solve_discrete_are(F.T, C.T, Q, R)
        return np.asarray(P @ C.T @ np.linalg.inv(C @ P @ C.T + R))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any force will do."""
        model = Model.of(self.model or nominal)
        return _part(n, dt, self.gains(model, dt), model)
