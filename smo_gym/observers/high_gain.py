"""The high-gain observer, with the plant's model and without."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.blocks import XHAT, Block, U, Y, at, four, offsets, put_four, two
from ..kernels.elementary import exp
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import positive_pair, switch
from .estimator import Compiling

PERIOD, POLES, MODEL = offsets(1, 2)


@for_each_model
def _estimate(rhs: Rhs, params: Params, use_model: bool) -> Block:
    def estimate(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            xhat, y, u, h = four(signals, XHAT, i), two(signals, Y, i), at(signals, U, i), at(own, PERIOD, i)
            pole = two(own, POLES, i)
            if use_model:
                q, theta, v, omega = rk4(rhs, xhat, (u,) + params(own, MODEL, i), h)  # noqa: RUF005
            else:
                q, theta, v, omega = xhat[0] + h * xhat[2], xhat[1] + h * xhat[3], xhat[2], xhat[3]
            b = exp(-pole[0] * h), exp(-pole[1] * h)
            e = y[0] - q, y[1] - theta
            q, theta = q + (1.0 - b[0] * b[0]) * e[0], theta + (1.0 - b[1] * b[1]) * e[1]
            v += (1.0 - b[0]) * (1.0 - b[0]) / h * e[0]
            omega += (1.0 - b[1]) * (1.0 - b[1]) / h * e[1]
            put_four(signals, XHAT, i, (q, theta, v, omega))

    return estimate


@dataclass(frozen=True, slots=True)
class HighGain(Compiling):
    """Both errors of each position decay as exp(-bandwidth t), at the samples exactly where the model is.

    ::

        e = y_k - q_new,   q_k = q_new + (1 - b^2) e,   v_k = v_new + (1 - b)^2 / h e,   b = exp(-bandwidth h)

    (q_new, v_new) is where the model goes within the period, or q + h v without one. It is the observer of Esfandiari
    and Khalil (Int. J. Control 56, 1992) with its poles placed in discrete time, so that no bandwidth is too large; at
    the largest it is the backward difference.

    Args:
        bandwidth: of each position, in 1/s.
        use_model: whether the plant's model predicts.
        model: of the plant; None for the nominal one.

    Raises:
        ValueError: a bandwidth is not positive.
    """

    bandwidth: tuple[float, float] = (60.0, 60.0)
    use_model: bool = True
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "bandwidth", positive_pair("bandwidth", self.bandwidth))
        object.__setattr__(self, "use_model", switch("use_model", self.use_model))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any force will do."""
        model = Model.of(self.model or nominal)
        block = _estimate(model.rhs, len(model.params), self.use_model)
        return Part(columns(n, dt, self.bandwidth, model.params), sample=block, period=PERIOD)
