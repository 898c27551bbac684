"""A magnet on the pivot that is not centred: its reading is off by harmonics of the angle, and counts."""

import math
from dataclasses import dataclass

import gymnasium

from smo_gym.kernels.blocks import Y0, X, Y, at, block, put_two, two
from smo_gym.kernels.elementary import rounded, sincos
from smo_gym.loop import Part, columns
from smo_gym.sensors import Sensor

FIRST, SECOND, COUNT = range(3)


@block
def _read(signals, own, lanes):
    for i in range(lanes):
        h, theta = two(signals, X, i)
        sine, cosine = sincos(theta)
        seen = theta + at(own, FIRST, i) * sine + at(own, SECOND, i) * (2.0 * sine * cosine)
        put_two(signals, Y0, i, two(signals, Y, i))
        put_two(signals, Y, i, (h, at(own, COUNT, i) * rounded(seen / at(own, COUNT, i))))


@dataclass(frozen=True)
class Hall(Sensor):
    """theta + e1 sin theta + e2 sin 2 theta in counts; h is exact."""

    harmonics: tuple[float, float] = (0.01, 0.02)  # e1, e2 in rad
    counts: int = 4096  # a turn
    exact = False

    def part(self, n, dt):
        return Part(columns(n, self.harmonics, 2.0 * math.pi / self.counts), sample=_read, reads=True)


gymnasium.register(
    "Hall-v0",
    entry_point="smo_gym.envs.pendulum:PendulumEnv",
    vector_entry_point="smo_gym.envs.vector:PendulumVectorEnv",
    kwargs={"sensor": Hall()},
)
