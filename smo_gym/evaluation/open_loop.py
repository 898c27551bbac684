"""Observers on the same trajectories: what a sensor reads of plants that a law on the true state controls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..observers import Oracle
from ..observers.protocol import Compiled
from ..observers.recorded import along
from ..plant import CartPendulum
from ..typing import Array
from .draws import deviations, noise


@dataclass(frozen=True, slots=True)
class Trajectories:
    """n plants and what is measured of them, at each of the sampling instants."""

    dt: float
    """Sampling period in s, which is the control period, too."""
    x: Array
    """States, (samples, 4, n)."""
    y: Array
    """Measured positions, (samples, 2, n)."""
    u: Array
    """Force in N from each sample to the next, (samples, n)."""
    nominal: CartPendulum
    force: float
    """Bound of the force in N."""

    def estimated(self, observer: Compiled) -> Array:
        """An observer's estimates, (samples, 4, n).

        Raises:
            ValueError: it cannot work with this sampling period and force.
        """
        part = observer.part(self.x.shape[2], self.dt, self.force, self.nominal)
        return along(part, np.full(len(self.x), self.dt), self.y, self.u)


def trajectories(
    environment: str, law: Any, state: Array, level: float, runs: int, seed: int, **options: Any
) -> Trajectories:
    """Simulate.

    Args:
        environment: its id.
        law: a compiled one, for the state [h, theta, h', theta'].
        state: the initial one, (4,), or one a run, (runs, 4).
        level: of uncertainty.
        runs: plants.
        seed: of plants and noise.
        **options: of the environment.

    Raises:
        ValueError: an option is not allowed.
    """
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        environment, runs, autoreset_mode=AutoresetMode.DISABLED, **options
    )
    task: Any = env.unwrapped.task  # type: ignore[attr-defined]
    plants = [task.params.perturbed(level * draw).as_array() for draw in deviations(seed, runs)]
    reset: Mapping[str, Any] = {"state": np.array(np.broadcast_to(state, (runs, 4))), "params": np.array(plants)}
    env.reset(options={**reset, **({"noise": np.array(noise(seed, runs))} if task.random else {})})
    parts = {"observer": Oracle().part(runs, task.dt, task.force_limit, task.params), "law": law.part(runs)}
    loop = env.unwrapped.loop.with_parts(**parts)  # type: ignore[attr-defined]
    loop.xhat[:] = loop.x
    instants = task.steps + 1
    x, y, u = np.empty((instants, 4, runs)), np.empty((instants, 2, runs)), np.zeros((instants, runs))
    x[0], y[0] = loop.x, loop.y
    for k in range(task.steps):
        loop.run(k)
        x[k + 1], y[k + 1], u[k] = loop.x, loop.y, loop.u
    return Trajectories(task.control_period, x, y, u, task.params, task.force_limit)
