"""Integral sliding mode around any law: the cart's velocity keeps to what the model says of it."""

from __future__ import annotations

import math

from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Block, U, at, four, offsets, put
from ..kernels.elementary import within
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.reaching import Hold, Reach
from ..kernels.rk4 import rk4
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import number
from .feedback import Feedback
from .reaching import Condition, Reaching

PREDICTED, Z, BEGUN, NOMINAL = offsets(1, 1, 1)
_SETTINGS = 4


@for_each_model
def _act(rhs: Rhs, params: Params, nominal: Block, rows: int, reach: Reach, hold: Hold) -> Block:
    PERIOD, LIMIT, K_1, K_2, MODEL = (NOMINAL + rows + i for i in range(_SETTINGS + 1))

    def act(signals: Array, own: Array, lanes: int) -> None:
        nominal(signals, own[NOMINAL * LANES :], lanes)
        for i in range(lanes):
            x, h, limit, k_1, k_2 = (
                four(signals, XHAT, i),
                at(own, PERIOD, i),
                at(own, LIMIT, i),
                at(own, K_1, i),
                at(own, K_2, i),
            )
            p, z = params(own, MODEL, i), at(own, Z, i)
            u_0 = within(at(signals, U, i), -limit, limit)
            gain = rhs(x, 0.0, (u_0 + 1.0,) + p)[2] - rhs(x, 0.0, (u_0,) + p)[2]  # noqa: RUF005
            predicted = at(own, PREDICTED, i) if at(own, BEGUN, i) > 0.0 else x[2]
            v, z_new = reach(x[2] - predicted, z, h, k_1, k_2)
            wanted = u_0 + v / gain
            u = within(wanted, -limit, limit)
            put(own, Z, i, z_new if u == wanted else hold(z, gain * (u - u_0), h, k_2))
            put(own, PREDICTED, i, predicted + rk4(rhs, x, (u_0,) + p, h)[2] - x[2])  # noqa: RUF005
            put(own, BEGUN, i, 1.0)
            put(signals, U, i, u)

    return act


class IntegralSlidingMode(Feedback):
    """``u = u_0 + v / g_h(xhat)``, where u_0 is a nominal law's force and v keeps sigma at 0.

    ::

        sigma = h'hat - h'hat(0) - integral of (f_h(xhat) + g_h(xhat) u_0)

    sigma is by how much the cart's velocity departs from what the model makes of u_0. It begins at 0, so nothing is to
    be reached (Utkin and Shi, Integral sliding mode in systems operating under uncertainty conditions, CDC 1996), and
    v, one of :class:`~smo_gym.controllers.reaching.Reaching`, is what a disturbance would need against itself.

    Why the cart's row: ``theta'' = (g sin theta - cos theta h'') / l`` holds whatever pushes the cart. Seen from h''
    the masses, a force on the cart and its friction are matched, and only the rod's length and the pivot's friction are
    not. And g_h = 1 / (M_c + m sin^2 theta) has one sign for all angles, which the projection of the force on both
    rows has not.

    What is promised: where the true rate of sigma is b v + d with ``|d'| < L``, gains that satisfy
    :meth:`Reaching.conditions` keep sigma at 0, and then the nominal law acts as if the matched part were not there.
    Where the promise ends: at the force's limit, ``|u_0| + |d| / g_h`` beyond ``limit`` loses sigma for a while; the
    unmatched part acts as ever; and sigma is the *estimate's*: while the observer has not converged, v fights the
    observer.

    Args:
        nominal: law for u_0.
        dt: control period in s.
        reaching: how v comes about.
        limit: of the force in N, that of the actuator; None for none.
        model: of the plant; Table 2's by default.
        disturbance: bound in N of a force on the cart that it is meant for; None for no claim.

    Raises:
        ValueError: a value is not allowed, or the limit leaves nothing beside the disturbance.
    """

    def __init__(
        self,
        nominal: Feedback,
        dt: float,
        reaching: Reaching | None = None,
        limit: float | None = None,
        model: Model | CartPendulum | None = None,
        disturbance: float | None = None,
    ) -> None:
        if not isinstance(nominal, Feedback):
            raise ValueError(f"nominal={nominal!r} must be a compiled law, such as Linear(...)")
        self.nominal, self.reaching = nominal, reaching or Reaching()
        self.dt = number("dt", dt, above=0.0)
        self.limit = None if limit is None else number("limit", limit, above=0.0)
        self.model = Model.of(model or CartPendulum())
        self.disturbance = None if disturbance is None else number("disturbance", disturbance)
        if self.disturbance is not None and not self.room().holds:
            raise ValueError(
                f"limit={self.limit:g} N is less than what a disturbance={self.disturbance:g} N needs alone: take a "
                "stronger actuator, or claim less"
            )

    def room(self) -> Condition:
        """What of the force is left for the nominal law beside the disturbance, in N."""
        limit = math.inf if self.limit is None else self.limit
        return Condition("limit > |disturbance|", limit - abs(self.disturbance or 0.0))

    @property
    def memory(self) -> int:
        """What the model predicts, the reaching law's integral, and what the nominal law remembers."""
        return NOMINAL + self.nominal.memory

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots.

        Raises:
            ValueError: the nominal law has gains for another number of slots.
        """
        inner = self.nominal.part(n)
        limit = math.inf if self.limit is None else self.limit
        settings = (self.dt, limit, self.reaching.k1, self.reaching.k2)
        rows = columns(n, [0.0, 0.0, 0.0], inner.rows, *settings, self.model.params)
        reach, hold = self.reaching.kernels
        return Part(rows, act=_act(self.model.rhs, len(self.model.params), inner.act, len(inner.rows), reach, hold))

    def __repr__(self) -> str:
        return f"IntegralSlidingMode({self.nominal!r}, dt={self.dt:g}, {self.reaching!r}, limit={self.limit})"
