"""Friction of cart and pivot, and a plant that has it, with what else stands between a force and its motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from .kernels import inlined
from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, FORCE, PUSH, X, at, block, finite, four, offsets, put, put_four, two
from .kernels.cart_pendulum import Forces, damped
from .kernels.friction import cut, uncut
from .kernels.rk4 import rk4
from .loop import Part, columns
from .typing import Array
from .validation import instance, number


@dataclass(frozen=True, slots=True)
class Friction:
    """Friction of the cart on its track and of the rod in its pivot; none by default.

    Sliding one way the cart is held back by ``cart_viscous h' + cart_coulomb``. At rest it stays while the force that
    this needs is at most ``cart_coulomb``. The rod is held back by the torque ``pivot_viscous theta'``.

    Args:
        cart_viscous: c_v in N s/m.
        cart_coulomb: F_C in N.
        pivot_viscous: b in N m s/rad.

    Raises:
        ValueError: a value is negative or not finite.
    """

    cart_viscous: float = 0.0
    cart_coulomb: float = 0.0
    pivot_viscous: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = number(field.name, getattr(self, field.name))
            if value < 0.0:
                raise ValueError(f"{field.name}={value!r} must be at least 0: friction brakes")
            object.__setattr__(self, field.name, value)

    @classmethod
    def of(cls, friction: Friction | Mapping[str, float] | None) -> Friction:
        """Friction from itself, a mapping of its fields or None (no friction).

        Raises:
            ValueError: an unknown field, or a value that is not allowed.
        """
        return instance(cls, "friction", friction)

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.as_array().any())

    def as_array(self) -> Array:
        """[c_v, F_C, b], shape (3,)."""
        return np.array([self.cart_viscous, self.cart_coulomb, self.pivot_viscous])


PARAMS, DT, FRICTION, BACK_EMF, BEFORE, MET, _ = offsets(4, 1, 3, 1, 4, 1)
VISCOUS, COULOMB, PIVOT, _ = offsets(1, 1, 1)
"""Rows of FRICTION."""


@inlined
def _forces(signals: Array, own: Array, i: int) -> Forces:
    (push, torque), (M_c, m, l, g) = two(signals, PUSH, i), four(own, PARAMS, i)
    c, b = at(own, FRICTION + VISCOUS, i) + at(own, BACK_EMF, i), at(own, FRICTION + PIVOT, i)
    return at(signals, FORCE, i) + push, torque, c, b, M_c, m, l, g


@block
def _rub(signals: Array, own: Array, lanes: int) -> None:
    dt = own[DT * LANES]
    coulomb = met = 0.0
    for i in range(lanes):
        coulomb += at(own, FRICTION + COULOMB, i)
    if coulomb > 0.0:
        for i in range(lanes):
            x = four(signals, X, i)
            new, event = uncut(x, _forces(signals, own, i), at(own, FRICTION + COULOMB, i), dt)
            put_four(own, BEFORE, i, x)
            put_four(signals, X, i, new)
            put(own, MET, i, 1.0 if event and at(signals, ALIVE, i) > 0.0 else 0.0)
        for i in range(lanes):
            met += at(own, MET, i)
    else:
        for i in range(lanes):
            x = four(signals, X, i)
            put_four(own, BEFORE, i, x)
            put_four(signals, X, i, rk4(damped, x, _forces(signals, own, i), dt))
    if met > 0.0:
        for i in range(lanes):
            x, new = four(own, BEFORE, i), four(signals, X, i)
            forces, event = _forces(signals, own, i), at(own, MET, i) > 0.0
            put_four(signals, X, i, cut(x, new, forces, at(own, FRICTION + COULOMB, i), dt) if event else new)
    for i in range(lanes):
        x, new = four(own, BEFORE, i), four(signals, X, i)
        alive, fine = at(signals, ALIVE, i) > 0.0, finite(new)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put_four(signals, X, i, new if alive and fine else x)
        h = new[0] if alive and fine else x[0]
        put(signals, FORCE, i, at(signals, FORCE, i) - at(own, BACK_EMF, i) * ((h - x[0]) / dt))


def rubbing(params: Array, dt: float, friction: Array, back_emf: float = 0.0) -> Part:
    """Plants with friction that the rows FORCE and PUSH move, else as :func:`~smo_gym.plant.moving`.

    A step is one of Runge-Kutta; :mod:`smo_gym.kernels.friction` says what Coulomb friction makes of it. Afterwards the
    row FORCE is less by what the motor's back-EMF has taken from it on average.

    Args:
        params: [M_c, m, l, g] of each slot, (4, n).
        dt: step in s.
        friction: [c_v, F_C, b] of each slot, (3, n).
        back_emf: what the motor's force loses, in N per m/s of the cart.
    """
    return Part(columns(params.shape[1], params, dt, friction, back_emf, np.zeros(5)), sample=_rub)
