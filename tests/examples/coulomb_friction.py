"""Coulomb friction of the cart: another plant in the loop, of which observers and laws are not told."""

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
from smo_gym.plant import DT, PARAMS, moving

FRICTION = DT + 1


@inlined
def _rubbing(x, s, inputs):
    friction, u, M_c, m, l, g = inputs
    return plant(x, s, (u - friction * tanh(100.0 * x[2]), M_c, m, l, g))


@block
def _step(signals, own, lanes):
    dt = own[DT * LANES]
    for i in range(lanes):
        x, (M_c, m, l, g) = four(signals, X, i), four(own, PARAMS, i)
        new = rk4(_rubbing, x, (at(own, FRICTION, i), at(signals, U, i), M_c, m, l, g), dt)
        alive, fine = at(signals, ALIVE, i) > 0.0, finite(new)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put_four(signals, X, i, new if alive and fine else x)


class Rubbing:
    """Either environment with friction in N."""

    def __init__(self, *given, friction=2.0, **options):
        super().__init__(*given, **options)
        frictionless = moving(self.loop.own("plant")[PARAMS:DT], self.task.dt)
        rows = columns(self.loop.n, frictionless.rows, friction)
        self.loop = self.loop.with_parts(plant=Part(rows, sample=_step))


class RubbingEnv(Rubbing, PendulumEnv):
    """One plant."""


class RubbingVectorEnv(Rubbing, PendulumVectorEnv):
    """A batch."""

    scalar = RubbingEnv


gymnasium.register("Rubbing-v0", entry_point=RubbingEnv, vector_entry_point=RubbingVectorEnv)
