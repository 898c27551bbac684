"""Where the plant should be at the instants that an episode meets."""

from __future__ import annotations

import numpy as np

from ..reference import Reference
from ..validation import multiple
from .task import Task


class Desired:
    """A task's reference, and then rest at its end.

    Attributes:
        instants: x_d at each sampling instant, (steps substeps + 1, 4).
        states: x_d at each control instant, (steps + 1, 4).
        positions: [h_d, theta_d] at the sampling instants of the control period that ends at each control instant,
            (steps + 1, substeps, 2).
        told: what the observation holds of it, x_d now and at the next ``preview`` control instants,
            (steps + 1, 4 (1 + preview)).
    """

    def __init__(self, task: Task, reference: Reference) -> None:
        n = task.substeps
        multiple("reference horizon", reference.horizon, "dt", task.dt)
        x_d = reference.trajectory(task.dt).T
        needed = (task.steps + task.preview) * n + 1
        if len(x_d) < needed and (np.any(reference.xT[2:]) or abs(np.sin(reference.xT[1])) > 1e-9):
            raise ValueError(f"reference xT={reference.xT} must be an equilibrium: the task goes on after its end")
        rest = np.repeat([reference.xT], max(needed - len(x_d), 0), axis=0)
        x_d = np.concatenate([x_d, rest])
        ahead = x_d[:needed:n]
        self.instants = x_d[: task.steps * n + 1]
        self.states = ahead[: task.steps + 1]
        later = x_d[1 : task.steps * n + 1, :2].reshape(task.steps, n, 2)
        self.positions = np.concatenate([np.repeat(x_d[None, :1, :2], n, axis=1), later])
        self.told = np.concatenate([ahead[j : j + task.steps + 1] for j in range(task.preview + 1)], axis=1)
