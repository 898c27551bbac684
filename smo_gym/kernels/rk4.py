"""The classical fourth-order Runge-Kutta step ("ode4" of the article's Table 1) on a state of four."""

import math
from collections.abc import Callable
from typing import Any

from ..typing import State
from . import inlined

STABLE = 2.785
"""A step of dt is stable for ``x' = -r x`` up to this r dt, the root of 1 - z/2 + z^2/6 - z^3/24."""

# A period that is not a multiple of the step has one step more if it is longer by this share of a step.
_SLACK = 1e-6


@inlined
def along(x: State, h: float, d: State) -> State:
    """``x + h d``."""
    return x[0] + h * d[0], x[1] + h * d[1], x[2] + h * d[2], x[3] + h * d[3]


@inlined
def rk4(rhs: Callable[[State, float, Any], State], x: State, inputs: Any, dt: float) -> State:
    """x(t + dt) for ``x' = rhs(x, s, inputs)``, where s in [0, 1] is how much of the step has passed."""
    a = rhs(x, 0.0, inputs)
    b = rhs(along(x, 0.5 * dt, a), 0.5, inputs)
    c = rhs(along(x, 0.5 * dt, b), 0.5, inputs)
    d = rhs(along(x, dt, c), 1.0, inputs)
    slope = (
        a[0] + 2.0 * (b[0] + c[0]) + d[0],
        a[1] + 2.0 * (b[1] + c[1]) + d[1],
        a[2] + 2.0 * (b[2] + c[2]) + d[2],
        a[3] + 2.0 * (b[3] + c[3]) + d[3],
    )
    return along(x, dt / 6.0, slope)


@inlined
def steps_of(period: float, step: float) -> tuple[int, float]:
    """How many steps of at most ``step`` a period has, and how long each of them is."""
    steps = math.ceil(period / step - _SLACK)
    return steps, period / steps
