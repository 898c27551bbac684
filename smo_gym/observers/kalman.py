"""The extended Kalman filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Block, U, Y, at, four, offsets, put, put_four, two
from ..kernels.elementary import exp, tanh
from ..kernels.linearised import halfway, jacobian, process_noise, ratio, transition
from ..kernels.matrices import congruent, corrected, diagonal, plus, put_symmetric, symmetric
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4, steps_of
from ..loop import Part, columns
from ..models import Model, known
from ..plant import CartPendulum
from ..typing import Array
from ..validation import number, positive_pair, short, whole
from .estimator import Compiling


@dataclass(frozen=True, slots=True)
class ExtendedKalmanFilter(Compiling):
    """Estimates the state as if the model lacked white noise in its accelerations, and the encoders had white noise.

    Over each step h of a sampling period the state is predicted with RK4, its covariance with the Jacobian A of the
    model halfway; then it is corrected with one measured position after the other::

        P  <- F P F' + Q,    F = I + A h + A^2 h^2 / 2                           predicted
        xhat <- xhat + K e,  P <- P - K s K',    e = y - xhat_1, s = P_11 + noise^2, K = P_{.1} / s

    The noise of the first acceleration acts as the input does, so that what pushes the cart turns the rod, too; that of
    the second acts on it alone. Jazwinski, Stochastic Processes and Filtering Theory (1970), chapter 8.

    Args:
        acceleration: square roots of the power spectral densities of both accelerations' noise, in m/s^2/sqrt(Hz) and
            rad/s^2/sqrt(Hz): how wrong the model is. An error of standard deviation a that lasts for about T seconds
            is like a sqrt(2 T).
        noise: standard deviations of the measured positions in m and rad; of counting alone a step / sqrt(12).
        velocity: standard deviations of the initial velocities, which are taken to be 0, in m/s and rad/s.
        saturation: how many standard deviations sqrt(s) each position's innovation is worth at most: e becomes
            b tanh(e / b) for b = saturation sqrt(s), which bounds what a faulty sensor does. None for no bound.
        adaptation: how fast the second acceleration's noise follows the innovations: at each sample its logarithm grows
            by adaptation (min(e^2 / s, 4) - 1.5), and is never below that of ``acceleration`` nor 64 times above. An
            error that stays, of the model, makes the filter doubt the model; one that a sensor makes for some samples
            hardly does. 0 for none; the cap of 4 and the 1.5 are chosen.
        substeps: integration steps in a sampling period.
        model: nominal plant; None for the one that the environment draws its plants around.

    Raises:
        ValueError: a value is not allowed.
    """

    acceleration: tuple[float, float] = (0.5, 2.0)
    noise: tuple[float, float] = (3e-5, 4.5e-4)
    velocity: tuple[float, float] = (1.0, 3.0)
    saturation: tuple[float | None, float | None] = (None, None)
    adaptation: float = 0.0
    substeps: int = 1
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        for name in ("acceleration", "noise", "velocity"):
            object.__setattr__(self, name, positive_pair(name, getattr(self, name)))
        object.__setattr__(self, "saturation", _levels(self.saturation))
        object.__setattr__(self, "adaptation", number("adaptation", self.adaptation))
        if self.adaptation < 0.0:
            raise ValueError(f"adaptation={self.adaptation!r} must be at least 0")
        object.__setattr__(self, "substeps", whole("substeps", self.substeps, 1))
        object.__setattr__(self, "model", known(self.model))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the filter puts into a loop of n slots."""
        model = Model.of(self.model or nominal)
        step, variance = dt / self.substeps, np.square(self.noise)
        bounded, levels = [s is not None for s in self.saturation], [s or 0.0 for s in self.saturation]
        covariance = diagonal(*variance, *np.square(self.velocity))
        settings = np.square(self.acceleration), variance, levels, self.adaptation, 0.0
        return Part(
            columns(n, dt, step, covariance, *settings, model.params),
            sample=_filter(model.rhs, len(model.params), *bounded, self.adaptation > 0.0),
            alike=(dt, step),
            period=PERIOD,
        )


def _levels(value: Any) -> tuple[float | None, float | None]:
    try:
        first, second = (None if each is None else number("saturation", each, above=0.0) for each in value)
    except (TypeError, ValueError):
        raise ValueError(
            f"saturation={short(value)} must be two numbers greater than 0, or None for no bound"
        ) from None
    return first, second


PERIOD, STEP, COVARIANCE, DENSITY, VARIANCE, LEVELS, RATE, DOUBT, MODEL = offsets(1, 1, 10, 2, 2, 2, 1, 1)
CAP, USUAL, MOST = 4.0, 1.5, math.log(64.0)
"""Of the adaptation: the most that a squared innovation counts, what is usual, and the largest logarithm."""


@inlined
def _bounded(e: float, most: float) -> float:
    return most * tanh(e / most)


@for_each_model
def _filter(rhs: Rhs, params: Params, first_bounded: bool, second_bounded: bool, adapting: bool) -> Block:
    def estimate(signals: Array, own: Array, lanes: int) -> None:
        steps, h = steps_of(own[PERIOD * LANES], own[STEP * LANES])
        for _ in range(steps):
            for i in range(lanes):
                x, u, p, q = four(signals, XHAT, i), at(signals, U, i), params(own, MODEL, i), two(own, DENSITY, i)
                new = rk4(rhs, x, (u,) + p, h)  # noqa: RUF005  # Numba unpacks no tuple here
                middle = halfway(x, new)
                F = transition(jacobian(rhs, middle, u, p), h)
                if adapting:
                    q = q[0], q[1] * exp(at(own, DOUBT, i))
                Q = process_noise(q, ratio(rhs, middle, u, p), h)
                put_four(signals, XHAT, i, new)
                put_symmetric(own, COVARIANCE, i, plus(congruent(F, symmetric(own, COVARIANCE, i)), Q))
        for i in range(lanes):
            x, P, y = four(signals, XHAT, i), symmetric(own, COVARIANCE, i), two(signals, Y, i)
            variance, levels = two(own, VARIANCE, i), two(own, LEVELS, i)
            e, s = y[0] - x[0], P[0] + variance[0]
            if first_bounded:
                e = _bounded(e, levels[0] * math.sqrt(s))
            x, P = corrected(x, P, (P[0], P[1], P[2], P[3]), e, s)
            e, s = y[1] - x[1], P[4] + variance[1]
            if adapting:
                doubt = at(own, DOUBT, i) + at(own, RATE, i) * (min(e * e / s, CAP) - USUAL)
                put(own, DOUBT, i, min(max(doubt, 0.0), MOST))
            if second_bounded:
                e = _bounded(e, levels[1] * math.sqrt(s))
            x, P = corrected(x, P, (P[1], P[4], P[5], P[6]), e, s)
            put_four(signals, XHAT, i, x)
            put_symmetric(own, COVARIANCE, i, P)

    return estimate
