"""Coulomb friction of the cart in a step of fixed length.

Its sign is held while the cart moves one way, so that the right-hand side is smooth and the step of fourth order. A
step in which the cart comes to rest, or comes loose, is cut there in two. A cart at rest stays there to the bit while
the force that this needs is within Coulomb's. One such event is seen in a step.
"""

import math

from ..typing import State
from . import inlined
from .cart_pendulum import Forces, damped, held
from .rk4 import rk4


@inlined
def _against(forces: Forces, coulomb: float) -> Forces:
    F, tau, c, b, M_c, m, l, g = forces
    return F - coulomb, tau, c, b, M_c, m, l, g


@inlined
def _rhs(x: State, s: float, inputs: tuple[Forces, bool]) -> State:
    forces, sticks = inputs
    moving, resting = damped(x, s, forces), held(x, s, forces)
    return (
        resting[0] if sticks else moving[0],
        resting[1] if sticks else moving[1],
        resting[2] if sticks else moving[2],
        resting[3] if sticks else moving[3],
    )


@inlined
def _along(x: State, forces: Forces, coulomb: float, way: float) -> float:
    """Acceleration that way, 1 or -1, of a cart that slides that way."""
    return way * damped(x, 0.0, _against(forces, way * coulomb))[2]


@inlined
def _pushed(x: State, forces: Forces) -> float:
    """The way that a cart without Coulomb friction would accelerate."""
    return math.copysign(1.0, damped(x, 0.0, forces)[2])


@inlined
def begins(x: State, forces: Forces, coulomb: float) -> tuple[float, bool]:
    """Which way the cart slides, 1 or -1, and whether it sticks instead: at rest, and no push moves it."""
    way = _pushed(x, forces) if x[2] == 0.0 else math.copysign(1.0, x[2])
    return way, x[2] == 0.0 and coulomb > 0.0 and _along(x, forces, coulomb, way) <= 0.0


@inlined
def uncut(x: State, forces: Forces, coulomb: float, dt: float) -> tuple[State, bool]:
    """x(t + dt) as if nothing happened in between, and whether something did."""
    way, sticks = begins(x, forces, coulomb)
    new = rk4(_rhs, x, (_against(forces, way * coulomb), sticks), dt)
    comes_loose = _along(new, forces, coulomb, _pushed(new, forces)) > 0.0
    turns = coulomb > 0.0 and way * new[2] < 0.0
    return new, comes_loose if sticks else turns


@inlined
def cut(x: State, new: State, forces: Forces, coulomb: float, dt: float) -> State:
    """x(t + dt) by two steps, one to where the cart comes to rest or loose, for the ``new`` of :func:`uncut`."""
    way, sticks = begins(x, forces, coulomb)
    onward = _pushed(new, forces)
    before, after = _along(x, forces, coulomb, onward), _along(new, forces, coulomb, onward)
    slope, last = dt * _along(x, forces, coulomb, way), dt * _along(new, forces, coulomb, way)
    s = before / (before - after) if sticks else _root(way * x[2], way * new[2], slope, last)
    h, theta, _, omega = rk4(_rhs, x, (_against(forces, way * coulomb), sticks), s * dt)
    middle = h, theta, 0.0, omega
    next_way, rests = begins(middle, forces, coulomb)
    next_way = onward if sticks else next_way
    return rk4(_rhs, middle, (_against(forces, next_way * coulomb), rests and not sticks), (1.0 - s) * dt)


@inlined
def _root(start: float, end: float, slope: float, last: float) -> float:
    """Where in [0, 1] the cubic with these values at 0 and 1 and slopes there falls through 0, ``start >= 0 > end``.

    From the root of the parabola without ``last``, one Newton step on the cubic.
    """
    bend = end - start - slope
    fall = math.sqrt(max(slope * slope - 4.0 * bend * start, 0.0))
    s = (slope + fall) / (-2.0 * bend) if slope > 0.0 else 2.0 * start / (fall - slope)
    cubic = slope + last - 2.0 * (end - start)
    square = bend - cubic
    value, rate = start + s * (slope + s * (square + s * cubic)), slope + s * (2.0 * square + 3.0 * s * cubic)
    s = s - value / rate if rate < 0.0 else s
    return min(max(s, 0.0), 1.0)
