"""A third-order homogeneous observer: it estimates the acceleration, too, or what the model lacks of it."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.blocks import XHAT, Block, U, Y, at, four, offsets, put_four, put_two, two
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..kernels.twisting import C_1, C_2, C_3, homogeneous
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, State
from ..validation import positive_pair, switch
from .estimator import Compiling

PERIOD, GAINS_1, GAINS_2, GAINS_3, VELOCITIES, ACCELERATIONS, MODEL = offsets(1, 2, 2, 2, 2, 2)


@for_each_model
def _estimate(rhs: Rhs, params: Params, use_model: bool) -> Block:
    def estimate(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            xhat, y, u, h = four(signals, XHAT, i), two(signals, Y, i), at(signals, U, i), at(own, PERIOD, i)
            z, a = two(own, VELOCITIES, i), two(own, ACCELERATIONS, i)
            if use_model:
                new: State = rk4(rhs, (xhat[0], xhat[1], z[0], z[1]), (u,) + params(own, MODEL, i), h)  # noqa: RUF005
            else:
                new = xhat[0] + h * z[0], xhat[1] + h * z[1], z[0], z[1]
            c_1, c_2, c_3 = two(own, GAINS_1, i), two(own, GAINS_2, i), two(own, GAINS_3, i)
            add_q, add_v, push = homogeneous(new[0], a[0], y[0], h, c_1[0], c_2[0], c_3[0])
            add_theta, add_omega, turn = homogeneous(new[1], a[1], y[1], h, c_1[1], c_2[1], c_3[1])
            v, omega = new[2] + add_v, new[3] + add_omega
            put_two(own, VELOCITIES, i, (v, omega))
            put_two(own, ACCELERATIONS, i, (push, turn))
            put_four(signals, XHAT, i, (new[0] + add_q, new[1] + add_theta, v + 0.5 * h * push, omega + 0.5 * h * turn))

    return estimate


@dataclass(frozen=True, slots=True)
class Homogeneous(Compiling):
    """Levant's second-order differentiator around the model, or without one, by an implicit step.

    ::

        q' = v + c_1 |e|^(2/3) sgn e,   v' = f(xhat, u) + a + c_2 |e|^(1/3) sgn e,   a' = c_3 sgn e,   e = y - q

    with c_1 = 2 L^(1/3), c_2 = 2.12 L^(2/3), c_3 = 1.1 L (Levant, Int. J. Control 76, 2003, in the form that is not
    nested). The step solves a cubic for the error at its end, and v + h a / 2 is the velocity that is told: Seeber's
    proper discretisation, which neither chatters nor is off where the acceleration stays (arXiv 2404.02770).

    Args:
        L: bound of the jerk that the model lacks, m/s^3 and rad/s^3; without a model of the jerk itself.
        use_model: whether the plant's model predicts.
        model: of the plant; None for the nominal one.

    Raises:
        ValueError: a bound is not positive.
    """

    L: tuple[float, float] = (50.0, 200.0)
    use_model: bool = True
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "L", positive_pair("L", self.L))
        object.__setattr__(self, "use_model", switch("use_model", self.use_model))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any force will do."""
        model = Model.of(self.model or nominal)
        gains = [c * L ** (order / 3.0) for order, c in enumerate((C_1, C_2, C_3), 1) for L in self.L]
        block = _estimate(model.rhs, len(model.params), self.use_model)
        return Part(columns(n, dt, gains, (0.0,) * 4, model.params), sample=block, period=PERIOD)
