"""Sliding mode on a plane in the state space, designed on the reduced dynamics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..kernels import inlined
from ..kernels.blocks import XD, XHAT, Block, U, at, error, four, offsets, put
from ..kernels.elementary import within
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.reaching import Hold, Reach
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, State
from ..validation import array, number, short, switch
from .feedback import Feedback, nominal
from .reaching import Condition, Reaching

Z, BEFORE, BEGUN, C, PERIOD, LIMIT, K_1, K_2, WRAP, MODEL = offsets(1, 1, 1, 4, 1, 1, 1, 1, 1)
_STEEPEST = 1e8
"""Condition number of the controllability matrix from which on a plant counts as not controllable."""


@inlined
def _dot(c: State, x: State) -> float:
    return c[0] * x[0] + c[1] * x[1] + c[2] * x[2] + c[3] * x[3]


@for_each_model
def _act(rhs: Rhs, params: Params, reach: Reach, hold: Hold) -> Block:
    def act(signals: Array, own: Array, lanes: int) -> None:
        for i in range(lanes):
            c, x, x_d = four(own, C, i), four(signals, XHAT, i), four(signals, XD, i)
            h, limit, z, p = at(own, PERIOD, i), at(own, LIMIT, i), at(own, Z, i), params(own, MODEL, i)
            k_1, k_2 = at(own, K_1, i), at(own, K_2, i)
            s, s_d = _dot(c, error(signals, i, at(own, WRAP, i))), _dot(c, x_d)
            rest = _dot(c, rhs(x, 0.0, (0.0,) + p))  # noqa: RUF005
            gain = _dot(c, rhs(x, 0.0, (1.0,) + p)) - rest  # noqa: RUF005
            rest -= (s_d - at(own, BEFORE, i)) / h if at(own, BEGUN, i) > 0.0 else 0.0
            v, z_new = reach(s, z, h, k_1, k_2)
            wanted = (v - rest) / gain
            u = within(wanted, -limit, limit)
            put(own, Z, i, z_new if u == wanted else hold(z, rest + gain * u, h, k_2))
            put(own, BEFORE, i, s_d)
            put(own, BEGUN, i, 1.0)
            put(signals, U, i, u)

    return act


def surface(poles: Sequence[complex], model: CartPendulum | None = None, theta: float = 0.0) -> Array:
    """The plane c x = 0 on which the linearised plant has the given poles, by Ackermann's formula: c (4,).

    ``c = [0 0 0 1] C^-1 p(A)`` with the controllability matrix C and p, of third order, the poles' polynomial; c B = 1
    (Ackermann and Utkin, Sliding mode control design based on Ackermann's formula, IEEE Trans. Automatic Control 43,
    1998).

    Args:
        poles: three, in 1/s, of negative real part; complex ones in pairs.
        model: of the plant; Table 2's by default.
        theta: equilibrium to linearise about.

    Raises:
        ValueError: poles that are not allowed, or a plant that is not controllable.
    """
    wanted = np.atleast_1d(np.asarray(poles, dtype=np.complex128))
    polynomial = np.poly(wanted)
    if wanted.shape != (3,) or not (wanted.real < 0.0).all() or np.abs(np.imag(polynomial)).max() > 1e-9:
        raise ValueError(f"poles={short(poles)} must be three of negative real part, complex ones in pairs")
    A, B = nominal(model).linearise(theta)
    powers = [np.linalg.matrix_power(A, k) for k in range(4)]
    reach = np.hstack([power @ B for power in powers])
    if not np.linalg.cond(reach) < _STEEPEST:
        raise ValueError(f"model={model} is not controllable: no surface gives the sliding motion these poles")
    p = sum(a.real * power for a, power in zip(polynomial[::-1], powers, strict=True))
    return np.asarray(np.linalg.solve(reach.T, [0.0, 0.0, 0.0, 1.0]) @ p)


class SurfaceControl(Feedback):
    """``u = (v - c (f(xhat) - x_d')) / (c g(xhat))``: s = c (xhat - x_d) then moves as s' = v, and s = 0 is kept.

    On the plane s = 0 the motion is of third order; :func:`surface` makes it what one wants. v is one of
    :class:`~smo_gym.controllers.reaching.Reaching`. x_d' is the reference's mean rate over the control period before.

    What breaks it: c g(theta) = (c_3 - c_4 cos(theta) / l) / (M_c + m sin^2 theta) changes its sign on the way round
    unless ``|c_4| < l c_3``, :meth:`conditions` says by how much that holds; the rod's length and the pivot's friction
    are not matched, and move the poles on the plane; at the force's limit s is lost for a while.

    Args:
        c: of the plane, shape (4,).
        dt: control period in s.
        reaching: how v comes about.
        limit: of the force in N, that of the actuator; None for none.
        model: of the plant; Table 2's by default.
        wrap: take the error of the angle within half a turn.

    Raises:
        ValueError: a value is not allowed.
    """

    def __init__(
        self,
        c: ArrayLike,
        dt: float,
        reaching: Reaching | None = None,
        limit: float | None = None,
        model: Model | CartPendulum | None = None,
        wrap: bool = True,
    ) -> None:
        self.c = array("c", c, (4,))
        self.c.flags.writeable = False
        self.dt = number("dt", dt, above=0.0)
        self.reaching = reaching or Reaching()
        self.limit = None if limit is None else number("limit", limit, above=0.0)
        self.model = Model.of(model or CartPendulum())
        self.wrap = switch("wrap", wrap)
        if self.gain(np.zeros(4)) == 0.0:
            raise ValueError(f"c={self.c.tolist()}: the force does not move s at x = 0, so nothing can keep it at 0")

    def gain(self, x: ArrayLike) -> float:
        """C g(x): how fast a force of 1 N moves s at a state, in 1/s."""
        return float(self.c @ (self.model.rate(x, 1.0) - self.model.rate(x, 0.0)))

    def conditions(self, reach: float = math.pi) -> tuple[Condition, ...]:
        """That c g keeps its sign for ``|theta| <= reach``: the margin is its least share of that at theta = 0."""
        share = [self.gain([0.0, theta, 0.0, 0.0]) / self.gain(np.zeros(4)) for theta in np.linspace(-reach, reach, 91)]
        return (Condition("c g(theta) keeps its sign", min(share)),)

    @property
    def memory(self) -> int:
        """The reaching law's integral, and where the reference was."""
        return 3

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots."""
        limit = math.inf if self.limit is None else self.limit
        settings = (self.dt, limit, self.reaching.k1, self.reaching.k2, float(self.wrap))
        rows = columns(n, [0.0, 0.0, 0.0], self.c, *settings, self.model.params)
        return Part(rows, act=_act(self.model.rhs, len(self.model.params), *self.reaching.kernels))

    def __repr__(self) -> str:
        return f"SurfaceControl(c={self.c.tolist()}, dt={self.dt:g}, {self.reaching!r}, limit={self.limit})"
