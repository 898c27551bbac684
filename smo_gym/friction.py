"""Friction of the cart and the pivot, and plants that rub."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .kernels import inlined
from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, FORCE, PUSH, X, at, block, finite, four, offsets, put, put_four, two
from .kernels.rk4 import State, rk4
from .kernels.rubbing import Inputs, around, eventful, motion, moved, rubbed
from .loop import Part, columns
from .typing import Array
from .validation import mapping, number


@dataclass(frozen=True, slots=True)
class Friction:
    """Friction forces that act against motion.

    Along the track ``-cart_viscous h' - cart_coulomb sgn(h')``, and at rest whatever up to ``cart_coulomb`` holds the
    cart; about the pivot ``-pivot_viscous theta'``. The power that they take is ``cart_viscous h'^2 + cart_coulomb |h'|
    + pivot_viscous theta'^2``.

    Args:
        cart_viscous: in N s/m.
        cart_coulomb: in N.
        pivot_viscous: in N m s/rad.

    Raises:
        ValueError: one of them is negative or not finite.
    """

    cart_viscous: float = 0.0
    cart_coulomb: float = 0.0
    pivot_viscous: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = number(field.name, getattr(self, field.name))
            if value < 0.0:
                raise ValueError(f"{field.name}={value!r} must be at least 0")
            object.__setattr__(self, field.name, value)

    @classmethod
    def of(cls, friction: Friction | Mapping[str, Any] | None) -> Friction:
        """Friction from itself, a mapping of field names or None.

        Raises:
            ValueError: an unknown field, or a value that is not allowed.
        """
        if isinstance(friction, Friction):
            return friction
        return cls(**mapping("friction coefficient", friction or {}, [field.name for field in fields(cls)]))

    def as_array(self) -> Array:
        """[cart_viscous, cart_coulomb, pivot_viscous], (3,)."""
        return np.array([self.cart_viscous, self.cart_coulomb, self.pivot_viscous])


PARAMS, DT, FRICTION, BACK_EMF, NEW, EVENT, _ = offsets(4, 1, 3, 1, 4, 1)
"""Own rows; the first two are where those of :func:`smo_gym.plant.moving` are."""


@inlined
def _inputs(signals: Array, own: Array, i: int) -> Inputs:
    (push, torque), (M_c, m, l, g) = two(signals, PUSH, i), four(own, PARAMS, i)
    c, coulomb, b = at(own, FRICTION, i) + at(own, BACK_EMF, i), at(own, FRICTION + 1, i), at(own, FRICTION + 2, i)
    return at(signals, FORCE, i) + push, torque, c, b, coulomb, M_c, m, l, g, 0.0, 0.0


@inlined
def _go(signals: Array, own: Array, i: int, new: State, dt: float) -> None:
    """Take a step where the run goes on, and say which force the motor was left with."""
    x = four(signals, X, i)
    alive, fine = at(signals, ALIVE, i) > 0.0, finite(new)
    put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
    put_four(signals, X, i, new if alive and fine else x)
    lost = at(own, BACK_EMF, i) * ((new[0] - x[0]) / dt)
    put(signals, FORCE, i, at(signals, FORCE, i) - (lost if alive and fine else 0.0))


@block
def _viscous(signals: Array, own: Array, lanes: int) -> None:
    dt = own[DT * LANES]
    for i in range(lanes):
        _go(signals, own, i, rk4(rubbed, four(signals, X, i), _inputs(signals, own, i), dt), dt)


@block
def _coulomb(signals: Array, own: Array, lanes: int) -> None:
    dt = own[DT * LANES]
    events = 0.0
    for i in range(lanes):
        x, inputs = four(signals, X, i), _inputs(signals, own, i)
        direction, held = motion(x, inputs)
        inputs = moved(inputs, direction, held)
        new = rk4(rubbed, x, inputs, dt)
        event = 1.0 if eventful(x, new, inputs) else 0.0
        put_four(own, NEW, i, new)
        put(own, EVENT, i, event)
        events += event
    if events > 0.0:
        for i in range(lanes):
            x, new, inputs = four(signals, X, i), four(own, NEW, i), _inputs(signals, own, i)
            direction, held = motion(x, inputs)
            cut = around(x, new, moved(inputs, direction, held), dt)
            put_four(own, NEW, i, cut if at(own, EVENT, i) > 0.0 else new)
    for i in range(lanes):
        _go(signals, own, i, four(own, NEW, i), dt)


def rubbing(params: Array, dt: float, friction: Array, back_emf: float = 0.0) -> Part:
    """Plants [M_c, m, l, g], (4, n), with friction (3, n), that move as those of :func:`smo_gym.plant.moving`.

    The force on the cart is what reaches it, the row FORCE, less ``back_emf`` times its speed, and a disturbance, the
    rows PUSH. Within a step the direction of Coulomb friction does not change, so that Runge-Kutta keeps its order; a
    step in which the cart comes to rest, or breaks away, is cut there. A cart at rest stays where it is, to the bit,
    until more than ``cart_coulomb`` pulls it.

    Args:
        params: plants.
        dt: integration step in s.
        friction: [cart_viscous, cart_coulomb, pivot_viscous] of each plant.
        back_emf: what the motor loses of its force with the cart's speed, in N s/m.
    """
    rubs = bool((friction[1] > 0.0).any())
    rows = columns(params.shape[1], params, dt, friction, back_emf, np.zeros(5))
    return Part(rows, sample=_coulomb if rubs else _viscous, alike=(float(rubs),))
