"""What sensors and actuator say of a control period: the measurements and forces that infos tell, and the truth."""

from __future__ import annotations

import numpy as np

from ..friction import FRICTION
from ..loop import Loop, Slots
from ..typing import Array
from .task import Task

Heard = tuple[Array, Array, Array, Array, dict[str, Array]]
"""Of a control period of n slots: where the plants were at each sampling instant, (substeps, 2, n); what was measured
then; the force in N that was asked for, within the limit, (n,); the mean force that reached the cart; and what only
some tasks have, (..., n): :class:`~smo_gym.envs.pendulum.PendulumEnv` says what and when.

A plain tuple, for it is made in every step; forces may be the loop's own."""


def held(heard: Heard, loop: Loop, slots: Slots) -> Heard:
    """The same but for some slots, where nothing has moved and no force has acted."""
    positions, samples, asked, force = (values.copy() for values in heard[:4])
    more = {name: values.copy() for name, values in heard[4].items()}
    positions[:, :, slots], samples[:, :, slots] = loop.x[:2, slots], loop.y[:, slots]
    asked[slots] = force[slots] = 0.0
    for name, values in more.items():
        values[..., slots] = loop.own("plant")[FRICTION : FRICTION + 3, slots] if name == "friction" else 0.0
    return positions, samples, asked, force, more


class Hearing:
    """Listens to a task's loop."""

    def __init__(self, task: Task) -> None:
        sensor, actuator = task.sensor, task.actuator
        self._plain = task.exact
        self._exact, self._ideal = sensor.exact, actuator.ideal
        self._rubs, self._pushed = bool(task.rubs), bool(task.disturbance)
        self._stamped, self._measured = sensor.jitter > 0.0, actuator.measured

    def still(self, loop: Loop) -> Heard:
        """Plants that have not moved yet."""
        positions = np.repeat(loop.x[None, :2], loop.substeps, axis=0)
        readings = np.zeros((loop.substeps, 6, loop.n))
        readings[:, :2] = loop.y
        return self._told(loop, np.zeros(loop.n), positions, readings)

    def drive(self, loop: Loop) -> Heard:
        """Run a control period."""
        positions = np.empty((loop.substeps, 2, loop.n))
        if self._plain:
            loop.run(positions=positions)
            return positions, positions.copy(), loop.u, loop.u, {}
        readings = np.empty((loop.substeps, 6, loop.n))
        loop.run(positions=positions, readings=readings)
        return self._told(loop, loop.u, positions, readings)

    def _told(self, loop: Loop, asked: Array, positions: Array, readings: Array) -> Heard:
        more = {}
        if self._rubs:
            more["friction"] = loop.own("plant")[FRICTION : FRICTION + 3].copy()
        if self._pushed:
            more["pushes"] = readings[:, 3:5].copy()
        if self._stamped:
            more["stamps"] = readings[:, 5].copy()
        if self._measured:
            more["forces"] = readings[:, 2].copy()
        samples = positions.copy() if self._exact else readings[:, :2].copy()
        # one after the other: how NumPy's mean sums up depends on n
        force = asked if self._ideal else np.cumsum(readings[:, 2], axis=0)[-1] / len(readings)
        return positions, samples, asked, force, more
