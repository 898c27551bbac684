"""What sensors and actuator say of a control period: the measurements and forces that infos tell, and the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..friction import FRICTION
from ..loop import Loop, Slots
from ..typing import Array
from .task import Task


@dataclass(frozen=True, slots=True)
class Heard:
    """What was measured and what was true in a control period of n slots."""

    positions: Array
    """Where the plants were at each sampling instant, (substeps, 2, n)."""
    samples: Array
    """What was measured then, (substeps, 2, n)."""
    asked: Array
    """The force in N that was asked for, within the limit, (n,)."""
    force: Array
    """The force in N that reached the cart, the mean over the period, (n,)."""
    more: dict[str, Array]
    """What only some tasks have, (..., n): :class:`~smo_gym.envs.pendulum.PendulumEnv` says what and when."""

    def held(self, loop: Loop, slots: Slots) -> Heard:
        """The same but for some slots, where nothing has moved and no force has acted."""
        more = {name: values.copy() for name, values in self.more.items()}
        for name, values in more.items():
            values[..., slots] = loop.own("plant")[FRICTION : FRICTION + 3, slots] if name == "friction" else 0.0
        held = Heard(self.positions.copy(), self.samples.copy(), self.asked.copy(), self.force.copy(), more)
        held.positions[:, :, slots] = loop.x[:2, slots]
        held.samples[:, :, slots] = loop.y[:, slots]
        held.asked[slots] = held.force[slots] = 0.0
        return held


class Hearing:
    """Listens to a task's loop."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._plain = task.exact
        self._rubs = bool(task.rubs)

    def still(self, loop: Loop) -> Heard:
        """Plants that have not moved yet."""
        positions = np.repeat(loop.x[None, :2], loop.substeps, axis=0)
        readings = np.zeros((loop.substeps, 6, loop.n))
        readings[:, :2] = loop.y
        return self._told(loop, positions, readings)

    def drive(self, loop: Loop) -> Heard:
        """Run a control period."""
        positions = np.empty((loop.substeps, 2, loop.n))
        if self._plain:
            loop.run(positions=positions)
            asked = loop.u.copy()
            return Heard(positions, positions.copy(), asked, asked.copy(), {})
        readings = np.empty((loop.substeps, 6, loop.n))
        loop.run(positions=positions, readings=readings)
        return self._told(loop, positions, readings)

    def _told(self, loop: Loop, positions: Array, readings: Array) -> Heard:
        task, asked, forces = self._task, loop.u.copy(), readings[:, 2]
        more = {}
        if self._rubs:
            more["friction"] = loop.own("plant")[FRICTION : FRICTION + 3].copy()
        if task.disturbance:
            more["pushes"] = readings[:, 3:5].copy()
        if task.sensor.jitter > 0.0:
            more["stamps"] = readings[:, 5].copy()
        if task.actuator.measured:
            more["forces"] = forces.copy()
        samples = positions.copy() if task.sensor.exact else readings[:, :2].copy()
        force = asked.copy() if task.actuator.ideal else np.cumsum(forces, axis=0)[-1] / len(forces)
        return Heard(positions, samples, asked, force, more)
