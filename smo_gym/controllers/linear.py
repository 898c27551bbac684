"""Linear feedback of the estimated state, with an integral of the cart's position and the reference's force."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from ..kernels.blocks import XD, Block, U, at, error, four, offsets, put
from ..kernels.elementary import within
from ..kernels.modelling import Params, Rhs, for_each_model
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import array, number, switch
from .feedback import Feedback

INTEGRAL, BEFORE, BEGUN, GAIN, K_I, PERIOD, LIMIT, WRAP, MODEL = offsets(1, 1, 1, 4, 1, 1, 1, 1)


@for_each_model
def _act(rhs: Rhs, params: Params, ahead: bool) -> Block:
    def act(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            K, e = four(own, GAIN, i), error(signals, i, at(own, WRAP, i))
            k_i, h, limit, integral = at(own, K_I, i), at(own, PERIOD, i), at(own, LIMIT, i), at(own, INTEGRAL, i)
            u = -(K[0] * e[0] + K[1] * e[1] + K[2] * e[2] + K[3] * e[3]) - k_i * integral
            if ahead:
                x_d, p = four(signals, XD, i), params(own, MODEL, i)
                rest, pushed = rhs(x_d, 0.0, (0.0,) + p)[2], rhs(x_d, 0.0, (1.0,) + p)[2]  # noqa: RUF005
                rate = (x_d[2] - at(own, BEFORE, i)) / h
                u += (rate - rest) / (pushed - rest) if at(own, BEGUN, i) > 0.0 else 0.0
                put(own, BEFORE, i, x_d[2])
                put(own, BEGUN, i, 1.0)
            # an integral that would drive a force at its limit further out stays as it is
            outwards = abs(u) > limit and u * k_i * e[0] < 0.0
            put(own, INTEGRAL, i, integral if outwards else integral + h * e[0])
            put(signals, U, i, within(u, -limit, limit))

    return act


class Linear(Feedback):
    """``u = -K e - k_i (integral of e_h) + u_d`` within a limit, with e = xhat - x_d, held over each control period.

    With ``k_i = 0`` and no reference the linear law that every other one has to beat: :class:`~smo_gym.LQR` within a
    limit. The integral stands still while the force is at its limit and e_h would drive it further.

    u_d is the reference's own force: what moves ``model`` along x_d as it moved over the control period before,
    ``(h_d'' - f_h(x_d)) / g_h(x_d)``; 0 in the first period.

    Args:
        K: gain in N/m, N/rad, N s/m, N s/rad, shape (4,).
        dt: control period in s.
        k_i: gain of the integral in N/(m s), at least 0 where the plant's sign asks for it.
        limit: of the force in N; None for none.
        model: of the plant, for the reference's force; None to do without.
        wrap: take the error of the angle within half a turn.

    Raises:
        ValueError: a value is not allowed.
    """

    def __init__(
        self,
        K: ArrayLike,
        dt: float,
        k_i: float = 0.0,
        limit: float | None = None,
        model: Model | CartPendulum | None = None,
        wrap: bool = True,
    ) -> None:
        self.K = array("K", K, (4,))
        self.K.flags.writeable = False
        self.dt = number("dt", dt, above=0.0)
        self.k_i = number("k_i", k_i)
        self.limit = None if limit is None else number("limit", limit, above=0.0)
        self.model = None if model is None else Model.of(model)
        self.wrap = switch("wrap", wrap)

    @property
    def memory(self) -> int:
        """The integral, and where the reference was."""
        return 3

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots."""
        limit = math.inf if self.limit is None else self.limit
        model = self.model or Model.of(CartPendulum())
        rows = columns(n, [0.0, 0.0, 0.0], self.K, self.k_i, self.dt, limit, float(self.wrap), model.params)
        return Part(rows, act=_act(model.rhs, len(model.params), self.model is not None))

    def __repr__(self) -> str:
        return f"Linear(K={self.K.tolist()}, k_i={self.k_i:g}, dt={self.dt:g}, limit={self.limit})"
