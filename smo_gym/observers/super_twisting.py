"""Super-twisting: Levant's differentiator, and the observer that has the plant's model besides."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.blocks import XHAT, Y0, Block, U, Y, at, four, offsets, put_four, put_two, two
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..kernels.twisting import explicit, implicit
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, State
from ..validation import choice, positive_pair
from .estimator import Compiling

SCHEMES = ("explicit", "implicit", "proper")
PERIOD, BOUNDS, VELOCITIES, MODEL = offsets(1, 2, 2)


@for_each_model
def _estimate(rhs: Rhs, params: Params, use_model: bool, scheme: str) -> Block:
    early, proper = scheme == "explicit", scheme == "proper"

    def estimate(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            xhat, y0, y, u = four(signals, XHAT, i), two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
            h, L, z = at(own, PERIOD, i), two(own, BOUNDS, i), two(own, VELOCITIES, i)
            if use_model:
                new: State = rk4(rhs, (xhat[0], xhat[1], z[0], z[1]), (u,) + params(own, MODEL, i), h)  # noqa: RUF005
            else:
                new = xhat[0] + h * z[0], xhat[1] + h * z[1], z[0], z[1]
            if early:
                q, v = explicit(xhat[0], z[0], new[0], new[2], y0[0], h, L[0])
                theta, omega = explicit(xhat[1], z[1], new[1], new[3], y0[1], h, L[1])
                put_two(own, VELOCITIES, i, (v, omega))
            else:
                add_q, add_v, push = implicit(new[0], y[0], h, L[0])
                add_theta, add_omega, turn = implicit(new[1], y[1], h, L[1])
                q, v, theta, omega = new[0] + add_q, new[2] + add_v, new[1] + add_theta, new[3] + add_omega
                put_two(own, VELOCITIES, i, (v, omega))
                if proper:
                    v, omega = v + 0.5 * h * push, omega + 0.5 * h * turn
            put_four(signals, XHAT, i, (q, theta, v, omega))

    return estimate


@dataclass(frozen=True, slots=True)
class SuperTwisting(Compiling):
    """The model, corrected by super-twisting injections of each position's error.

    ::

        q' = v + k_1 sqrt(L |e|) sgn e,   v' = f(xhat, u) + k_2 L sgn e,   e = y - q,   k_1 = 1.5, k_2 = 1.1

    Davila, Fridman and Levant, Second-order sliding-mode observer for mechanical systems (IEEE Trans. Automatic Control
    50, 2005): without noise the estimate is exact after a finite time where L bounds the drift that the model lacks.

    Schemes: ``"explicit"`` is Euler's step with the error at the sample before, and chatters; ``"implicit"`` solves for
    the error at its end (Acary and Brogliato 2010) and does not, but tells the velocity of the middle of the period,
    h / 2 times that drift off; ``"proper"`` adds h / 2 times the acceleration that the step has found, so that a drift
    that stays leaves no error.

    Once the error is 0 and without a model, "implicit" is the backward difference and "proper" the three-point formula
    (3 y_k - 4 y_{k-1} + y_{k-2}) / (2 h). That is the output which Seeber makes of the three states of the second-order
    differentiator (Proper implicit discretization of arbitrary-order robust exact differentiators, arXiv 2404.02770;
    here :class:`~smo_gym.observers.homogeneous.Homogeneous`). His first-order one has no third state and tells the
    backward difference; that what the step has found may stand in for it is ours. It costs: an acceleration that jumps
    within L makes an error of up to 2/3 h L instead of 1/2 h L, noise of at most eps one of 4 eps / h instead of
    2 eps / h.

    Args:
        L: bound of the acceleration that the model lacks, m/s^2 and rad/s^2.
        scheme: "explicit", "implicit" or "proper".
        model: of the plant; None for the nominal one.

    Raises:
        ValueError: a bound is not positive, or the scheme is another one.
    """

    L: tuple[float, float] = (5.0, 15.0)
    scheme: str = "proper"
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "L", positive_pair("L", self.L))
        choice("scheme", self.scheme, SCHEMES)

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any force will do."""
        return _part(n, dt, self.L, self.scheme, Model.of(self.model or nominal), True)


@dataclass(frozen=True, slots=True)
class Levant(Compiling):
    """Levant's robust exact differentiator, :class:`SuperTwisting` without a model: L bounds the acceleration itself.

    Levant, Robust exact differentiation via sliding mode technique (Automatica 34, 1998): with noise of at most eps the
    error is of the order sqrt(L eps), and no differentiator has a better order.

    Args:
        L: bound of the acceleration, m/s^2 and rad/s^2.
        scheme: "explicit", "implicit" or "proper", as there.

    Raises:
        ValueError: a bound is not positive, or the scheme is another one.
    """

    L: tuple[float, float] = (20.0, 60.0)
    scheme: str = "proper"

    def __post_init__(self) -> None:
        object.__setattr__(self, "L", positive_pair("L", self.L))
        choice("scheme", self.scheme, SCHEMES)

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any plant and force will do."""
        return _part(n, dt, self.L, self.scheme, Model.of(nominal), False)


def _part(n: int, dt: float, L: tuple[float, float], scheme: str, model: Model, use_model: bool) -> Part:
    block = _estimate(model.rhs, len(model.params), use_model, scheme)
    return Part(columns(n, dt, L, (0.0, 0.0), model.params), sample=block, period=PERIOD)
