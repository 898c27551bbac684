"""Stribeck's effect, friction that falls as the cart gets under way: another plant in the loop, which nobody knows.

With an actuator or a disturbance it would read the rows FORCE and PUSH in place of U.
"""

import gymnasium

from smo_gym.envs.pendulum import PendulumEnv
from smo_gym.envs.vector import PendulumVectorEnv
from smo_gym.kernels import inlined
from smo_gym.kernels.batch import LANES
from smo_gym.kernels.blocks import ALIVE, FAILED, U, X, at, block, finite, four, put, put_four
from smo_gym.kernels.cart_pendulum import plant
from smo_gym.kernels.elementary import tanh
from smo_gym.kernels.rk4 import rk4
from smo_gym.loop import Part, columns
from smo_gym.plant import DT, PARAMS

BREAKAWAY, SLIDING = DT + 1, DT + 2
SPEED = 0.05  # m/s, at which friction is half way between the two


@inlined
def _rubbing(x, s, inputs):
    breakaway, sliding, u, M_c, m, l, g = inputs
    ratio = x[2] / SPEED
    friction = sliding + (breakaway - sliding) / (1.0 + ratio * ratio)
    return plant(x, s, (u - friction * tanh(1000.0 * x[2]), M_c, m, l, g))


@block
def _step(signals, own, lanes):
    dt = own[DT * LANES]
    for i in range(lanes):
        x, (M_c, m, l, g) = four(signals, X, i), four(own, PARAMS, i)
        rubs = at(own, BREAKAWAY, i), at(own, SLIDING, i), at(signals, U, i)
        new = rk4(_rubbing, x, (*rubs, M_c, m, l, g), dt)
        alive, fine = at(signals, ALIVE, i) > 0.0, finite(new)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put_four(signals, X, i, new if alive and fine else x)


class Stribeck:
    """Either environment with friction in N: ``breakaway`` about rest, ``sliding`` when it moves."""

    def __init__(self, *given, breakaway=2.0, sliding=1.0, **options):
        super().__init__(*given, **options)
        rows = columns(self.loop.n, self.loop.own("plant"), breakaway, sliding)
        self.loop = self.loop.with_parts(plant=Part(rows, sample=_step))


class StribeckEnv(Stribeck, PendulumEnv):
    """One plant."""


class StribeckVectorEnv(Stribeck, PendulumVectorEnv):
    """A batch."""

    scalar = StribeckEnv


gymnasium.register("Stribeck-v0", entry_point=StribeckEnv, vector_entry_point=StribeckVectorEnv)
