"""Reaching laws: the rate v = sigma' - (what is not known) that brings a sliding variable to 0, over one step."""

import math
from collections.abc import Callable

from . import inlined
from .twisting import clipped, sign

Reach = Callable[[float, float, float, float, float], tuple[float, float]]
"""``reach(sigma, z, h, k_1, k_2)`` gives v, held over a step of h seconds, and the law's integral z after it."""
Hold = Callable[[float, float, float, float], float]
"""``hold(z, v, h, k_2)`` gives that integral where the actuator lets only the rate v act."""


@inlined
def sign_explicit(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``v = -k_1 sgn sigma``."""
    return -k_1 * sign(sigma), z


@inlined
def sign_implicit(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``v = -k_1 xi``, xi in Sgn(sigma + h v): the projection of sigma / (h k_1) on [-1, 1]."""
    return -k_1 * clipped(sigma / (h * k_1)), z


@inlined
def layer(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``v = -k_1 sat(sigma / k_2)``: a boundary layer of the width k_2."""
    return -k_1 * clipped(sigma / k_2), z


@inlined
def twisting_explicit(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``v = -k_1 sqrt|sigma| sgn sigma + z``, ``z' = -k_2 sgn sigma``, by Euler's step."""
    return -k_1 * math.sqrt(abs(sigma)) * sign(sigma) + z, z - h * k_2 * sign(sigma)


@inlined
def _solved(b: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``k_1 s sgn b`` and ``h k_2 xi`` with xi in Sgn b, so that ``|b| = s^2 + h k_1 s + h^2 k_2 |xi|``."""
    least = h * h * k_2
    rest = max(abs(b) - least, 0.0)
    root = 0.5 * (math.sqrt(h * h * k_1 * k_1 + 4.0 * rest) - h * k_1)
    return k_1 * root * sign(b), h * k_2 * clipped(b / least)


@inlined
def twisting_implicit(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """The same with sigma at the step's end on the right-hand side, as if d were 0: ``sigma+ = sigma + h v``."""
    root, push = _solved(sigma + h * z, h, k_1, k_2)
    z -= push
    return z - root, z


@inlined
def twisting_predicting(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """The same with -z for d: see :class:`~smo_gym.controllers.reaching.Reaching`."""
    root, push = _solved(sigma, h, k_1, k_2)
    z -= push
    return z - root - push, z


@inlined
def proportional_integral(sigma: float, z: float, h: float, k_1: float, k_2: float) -> tuple[float, float]:
    """``v = -k_1 sigma + z``, ``z' = -k_2 sigma``, as the predicting step above."""
    after = sigma / (1.0 + h * k_1 + h * h * k_2)
    push = h * k_2 * after
    z -= push
    return -k_1 * after + z - push, z


@inlined
def nothing_held(z: float, v: float, h: float, k_2: float) -> float:
    """The integral as it is."""
    return z


@inlined
def conditioned(z: float, v: float, h: float, k_2: float) -> float:
    """``z' = k_2 sgn(v - z)``: the integral goes towards what acts."""
    return z + min(max(v - z, -h * k_2), h * k_2)
