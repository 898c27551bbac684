"""What an environment puts into its loop: actuator, plant, encoders, and what is said of a control period."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from gymnasium import logger
from numpy.typing import ArrayLike

from .. import disturbances, sensors
from ..actuators import force_sensor, limited
from ..friction import FRICTION, rubbing
from ..kernels.blocks import ALIVE, FAILED, REWARD, XD, U, X, at, block, four, offsets, put
from ..kernels.noise import uniforms
from ..loop import Loop, Part, Slots, columns
from ..plant import PARAMS, moving
from ..typing import Array, Flags
from ..validation import short
from .task import Case, Task

OF_FRICTION = (60, 61, 62)
"""Streams of an episode's random numbers at its start that its friction is drawn from."""
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
    parts = {"sensor": task.sensor.part(n, task.dt), "end": judged(task, n)}
    if task.ideal:
        parts |= {"actuator": limited(n, task.force_limit), "plant": moving(params, task.dt)}
    else:
        friction = np.repeat(task.rubs.as_array()[:, None], n, axis=1)
        parts |= {
            "actuator": task.actuator.part(n, task.force_limit, task.dt),
            "plant": rubbing(params, task.dt, friction, task.actuator.back_emf),
        }
    if task.disturbance:
        parts["disturbance"] = disturbances.part(task.disturbance, n, task.dt)
    if task.actuator.measured:
        parts["force sensor"] = force_sensor(n)
    return Loop(n, task.substeps, parts)


def begin(loop: Loop, task: Task, slots: Slots, cases: Sequence[Case]) -> None:
    """Begin an episode each in some slots; an observer is left alone."""
    keys = np.array([case.key for case in cases])
    for role in loop.parts.keys() & {"actuator", "disturbance", "force sensor", "sensor"}:
        loop.restart(role, slots)
    plant = loop.own("plant")
    plant[PARAMS : PARAMS + 4, slots] = np.array([case.params for case in cases]).T
    if not task.ideal:
        scale = 1.0 + task.friction_uncertainty * (2.0 * uniforms(keys, OF_FRICTION) - 1.0)
        plant[FRICTION : FRICTION + 3, slots] = task.rubs.as_array()[:, None] * scale
    if task.sensor.random:
        loop.own("sensor")[sensors.KEY, slots] = keys
    if task.disturbance:
        disturbances.begin(loop.own("disturbance"), slots, task.disturbance, keys)
    loop.begin(slots, np.array([case.state for case in cases]).T)


def complain(loop: Loop, ended: Flags) -> None:
    """Warn of a disturbance that was not finite and has just ended episodes, (n,)."""
    when = disturbances.refused(loop)
    for slot in np.flatnonzero(ended & (when > 0.0)):
        logger.warn(f"slot {slot}: its disturbance was not finite at t = {when[slot]:g} s, which ends the episode")


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
