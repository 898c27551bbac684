"""One step of super-twisting and of its third-order brother, for one position; discretised in three ways."""

import math

from . import inlined
from .elementary import cube_root_above

# Levant, Robust exact differentiation via sliding mode technique, Automatica 34 (1998).
K_1, K_2 = 1.5, 1.1
# Levant, Higher-order sliding modes, Int. J. Control 76 (2003), in the form that is not nested.
C_1, C_2, C_3 = 2.0, 2.12, 1.1


@inlined
def sign(x: float) -> float:
    """Sgn x, 0 at 0."""
    return (1.0 if x > 0.0 else 0.0) - (1.0 if x < 0.0 else 0.0)


@inlined
def clipped(x: float) -> float:
    """The value within [-1, 1] next to x: in an implicit step the set-valued sgn is this."""
    return min(max(x, -1.0), 1.0)


@inlined
def explicit(q: float, v: float, q_new: float, v_new: float, y: float, h: float, L: float) -> tuple[float, float]:
    """Euler's step from (q, v) with the error at its beginning.

    ::

        q+ = q_new - h k_1 sqrt(L |e|) sgn e,   v+ = v_new - h k_2 L sgn e,   e = q - y

    Args:
        q: position at the beginning.
        v: velocity.
        q_new: where these would be at the end without any correction.
        v_new: the same of the velocity.
        y: position that was measured at the beginning.
        h: step in s.
        L: bound of the acceleration that is not in ``v_new``.
    """
    e = q - y
    return q_new - h * K_1 * math.sqrt(L * abs(e)) * sign(e), v_new - h * K_2 * L * sign(e)


@inlined
def implicit(q_new: float, y: float, h: float, L: float) -> tuple[float, float, float]:
    """What Euler's implicit step adds to the position and to the velocity, and the acceleration that it found.

    With e = y - q+ at the end, b = y - q_new and xi in Sgn e::

        q+ = q_new + h (k_1 sqrt(L |e|) sgn e + h k_2 L xi),   v+ = v_new + h k_2 L xi

    so that |b| = |e| + h k_1 sqrt(L |e|) + h^2 k_2 L |xi|: either e = 0, or xi = sgn b and a quadratic gives sqrt|e|
    (Acary and Brogliato, Implicit Euler numerical scheme and chattering-free implementation of sliding mode systems,
    Systems & Control Letters 59, 2010).
    """
    b = y - q_new
    a_1, a_2 = K_1 * math.sqrt(L), K_2 * L
    push = a_2 * clipped(b / (h * h * a_2))
    beyond = max(abs(b) - h * h * a_2, 0.0)
    root = 0.5 * (math.sqrt(h * h * a_1 * a_1 + 4.0 * beyond) - h * a_1)
    return h * (a_1 * root * sign(b) + h * push), h * push, push


@inlined
def _halley(s: float, a: float, b: float, c: float) -> float:
    """A step of Halley's method on s^3 + a s^2 + b s = c."""
    value, slope = ((s + a) * s + b) * s - c, (3.0 * s + 2.0 * a) * s + b
    return s - value * slope / (slope * slope - value * (3.0 * s + a))


@inlined
def positive_root(a: float, b: float, c: float) -> float:
    """The s >= 0 where s^3 + a s^2 + b s = c, for numbers that are not negative and b > 0.

    Each term alone bounds it from above; the least of these bounds is at most three times the root, and from there
    three steps leave nothing but rounding.
    """
    s = min(c / b, math.sqrt(c / a), cube_root_above(c))
    return _halley(_halley(_halley(s, a, b, c), a, b, c), a, b, c)


@inlined
def homogeneous(
    q_new: float, a: float, y: float, h: float, c_1: float, c_2: float, c_3: float
) -> tuple[float, float, float]:
    """The same of third order: what is added to position and velocity, and the acceleration a+ that is left over.

    With s = |e|^(1/3)::

        q+ = q_new + h (c_1 s^2 sgn e + (v+ - v_new)),   v+ = v_new + h (c_2 s sgn e + a+),   a+ = a + h c_3 xi

    where b = y - q_new - h^2 a and |b| = s^3 + h c_1 s^2 + h^2 c_2 s + h^3 c_3 |xi|.
    """
    b = y - q_new - h * h * a
    least = h * h * h * c_3
    a += h * c_3 * clipped(b / least)
    rest = max(abs(b) - least, 0.0)
    s = positive_root(h * c_1, h * h * c_2, rest)
    more = h * (c_2 * s * sign(b) + a)
    return h * (c_1 * s * s * sign(b)) + h * more, more, a
