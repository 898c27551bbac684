"""What an environment puts into its loop: actuator, plant, encoders, and what is said of a control period."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..actuators import limited
from ..kernels.blocks import ALIVE, FAILED, REWARD, XD, U, X, at, block, four, offsets, put
from ..loop import Loop, Part, columns
from ..plant import moving
from ..sensors import exact
from ..typing import Array, Flags
from ..validation import short
from .task import Task

WEIGHTS, FORCE_WEIGHT, PENALTY, TRACK, ANGLE, _ = offsets(4, 1, 1, 1, 1)


@block
def _judge(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        x, x_d, q, u = four(signals, X, i), four(signals, XD, i), four(own, WEIGHTS, i), at(signals, U, i)
        e = x[0] - x_d[0], x[1] - x_d[1], x[2] - x_d[2], x[3] - x_d[3]
        squares = q[0] * (e[0] * e[0]) + q[1] * (e[1] * e[1]) + q[2] * (e[2] * e[2]) + q[3] * (e[3] * e[3])
        cost = squares + at(own, FORCE_WEIGHT, i) * (u * u)
        going, lost = at(signals, ALIVE, i) > 0.0, at(signals, FAILED, i)
        finite = math.isfinite(x[0] + x[1] + x[2] + x[3] + cost) and lost == 0.0
        inside = finite and abs(x[0]) <= at(own, TRACK, i) and abs(x[1]) <= at(own, ANGLE, i)
        # a state that is not finite has no cost, only the penalty
        reward = -(cost if finite else 0.0) - (0.0 if inside else at(own, PENALTY, i))
        put(signals, REWARD, i, reward if going else 0.0)
        put(signals, FAILED, i, 1.0 if going and not inside else lost)


def judged(task: Task, n: int) -> Part:
    """The reward of a control period (:class:`~smo_gym.envs.task.Reward` has the equation) and the end of runs."""
    reward = task.reward
    weights = [weight * task.control_period for weight in (*reward.q, reward.r)]
    return Part(columns(n, weights, reward.failure, task.track_limit, task.angle_limit), close=_judge)


def loop_of(task: Task, n: int) -> Loop:
    """The loop of n slots of a task, still without observer and law."""
    params = np.repeat(task.params.as_array()[:, None], n, axis=1)
    return Loop(
        n,
        task.substeps,
        {
            "actuator": limited(n, task.force_limit),
            "plant": moving(params, task.dt),
            "sensor": exact(n),
            "end": judged(task, n),
        },
    )


def checked_force(action: ArrayLike, n: int, ignored: Flags | None = None) -> Array:
    """The forces in N that actions (n, 1) ask for, (n,): 0 where ignored.

    Raises:
        ValueError: the shape is not (n, 1), or an action is not finite.
    """
    try:
        wanted = np.array(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"action={short(action)} must be an array of numbers of shape {(n, 1)}") from None
    if wanted.shape != (n, 1):
        raise ValueError(f"action has shape {wanted.shape}, it must have shape {(n, 1)}")
    force: Array = wanted[:, 0]
    if ignored is not None:
        force[ignored] = 0.0
    fine = np.isfinite(force)
    if np.count_nonzero(fine) < n:
        slot = int(np.argmin(fine))
        raise ValueError(f"action={force[slot]} (slot {slot}) must be finite")
    return force
