"""A cart on a belt with a pole on a potentiometer (SensorsINI/CartPoleSimulation), the article's own kind of plant.

All numbers are identified: model and noise by the likelihood of an EKF's innovations on 60 training runs, which
:func:`.fitting.fit` finds again; the potentiometer's scale by the same, its gap read off the recordings. The noise of
the cart's position is that of its steps alone: free, it goes to 0.
"""

import math

import numpy as np

from ..kernels import inlined
from ..kernels.elementary import sincos, tanh
from ..models import Model
from ..typing import Array, Flags, State
from .rig import Rig

SCALE = 0.96
"""Radians of the pole for a radian of reading; the rest of a turn is made up in the gap."""
GAP, STUCK = 1.15, (1.0, 1.35)
"""Reading at which the potentiometer's gap begins, and the readings around it that are not to be believed, in rad."""
_TURN = 2.0 * math.pi


@inlined
def _motion(x: State, s: float, inputs: tuple[float, ...]) -> State:
    """Pole and cart, each with friction, the cart driven by a motor whose back-EMF is most of its damping.

    ::

        theta'' = a sin(theta - o) + k cos(theta - o) h'' - b theta'
        h''     = c (u + u0) - d h' - e sgn h' + r (cos(theta - o) theta'' - sin(theta - o) theta'^2)

    sgn is tanh(h' / 0.01 m/s).
    """
    _, theta, v, omega = x
    u, a, k, b, o, c, d, e, r, u0 = inputs
    sin, cos = sincos(theta - o)
    free = a * sin - b * omega
    v_dot = c * (u + u0) - d * v - e * tanh(100.0 * v) + r * (cos * free - sin * omega * omega)
    v_dot /= 1.0 - r * k * cos * cos
    return v, omega, v_dot, free + k * cos * v_dot


def corrected(reading: Array) -> tuple[Array, Flags]:
    """The pole's angle from the potentiometer's unwrapped reading, and where that says nothing."""
    turns = np.floor((reading - GAP) / _TURN) + 1.0
    within = (reading + math.pi) % _TURN - math.pi
    return SCALE * reading + _TURN * (1.0 - SCALE) * turns, (within > STUCK[0]) & (within < STUCK[1])


CART_POLE = Rig(
    name="cartpole",
    channels=("h_dot", "theta_dot"),
    units=("m/s", "rad/s"),
    model=Model(_motion, (37.27, 3.991, 0.078, 0.0011, 9.564, 16.20, 0.182, 0.0062, 0.0030)),
    period=0.02029,
    numbers=("a", "k", "b", "o", "c", "d", "e", "r", "u0"),
    quanta=(8.4979e-5, SCALE * _TURN / 4096.0),
    noise=(2.45e-5, 1.58e-3),
    acceleration=(0.0812, 0.232),
    columns=("time", "position", "angle", "Q"),
    corrected=corrected,
    delay=0.0,
    unscored=(25, 12),
    lost=0.5,
    window=(7, 4),
    jerk=(1500.0, 150.0),  # chosen: on twins it is 0.0093 m/s and 0.059 rad/s from the truth
    parts={"gain": (4,), "inverse_length": (0, 1)},
    held=("noise h",),
)
