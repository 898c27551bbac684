"""The two drivers of a closed loop, to the same bits: compiled from end to end, or a step of Python a period."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from ..actuators import REFUSED
from ..controllers import Agent, title
from ..envs.desired import Desired
from ..envs.task import Task
from ..envs.vector import PendulumVectorEnv
from ..kernels.blocks import X, Y, block, put_two, two
from ..loop import Loop, Part
from ..typing import Array
from ..wrappers import VectorObserverWrapper
from ..wrappers.inside import as_they_are
from .guard import diverged, guard
from .traces import Watch

_EVERY = slice(None)
_SLOT_STEPS = 2_000_000
"""Sampling instants of slots that are driven at once: some hundredths of a second, after which progress is told."""


def loop_inside(env: VectorEnv[Array, Array, Array]) -> PendulumVectorEnv | None:
    """The environment in whose loop an observer stands, where nothing else happens in a step; else None."""
    inner = env.unwrapped
    if not isinstance(env, VectorObserverWrapper) or not env.plugged or env.env is not inner:
        return None
    return inner if as_they_are(env, VectorObserverWrapper) else None  # type: ignore[return-value]


def driven(env: PendulumVectorEnv, law: Any, parts: Mapping[str, Part], watch: Watch) -> Loop:
    """Drive a law with a ``part`` from a reset to the horizon, many control periods a call.

    Raises:
        ValueError: the law's force is not finite.
    """
    n, task = env.num_envs, env.task
    try:
        part = law.part(n)
    except Exception as error:  # whatever a user's law may raise
        raise ValueError(f"{title(law)}: cannot act on {n} plants ({type(error).__name__}: {error})") from error
    loop = env.loop.with_parts(law=part, guard=guard(env.loop), **parts)
    reference = np.empty((0, 4))
    if task.reference is not None:
        reference = Desired(task, task.reference).instants
        loop.x_d[:] = reference[0][:, None]
    stride = watch.stride or max(_SLOT_STEPS // (task.substeps * n), 1)
    watch.look(0, loop)
    for k in range(0, task.steps, stride):
        periods = min(stride, task.steps - k)
        loop.run(k, periods, reference)
        refused = loop.own("actuator")[REFUSED]
        if np.count_nonzero(refused):
            slot = int(np.flatnonzero(refused)[0])
            raise ValueError(f"{title(law)}: action={refused[slot]} (slot {slot}) must be finite")
        watch.look(k + periods, loop)
        watch.progress(periods)
        if not watch.recorders and not loop.alive.any():
            break
    return loop


@block
def _follow(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put_two(signals, X, i, two(signals, Y, i))


def asked(
    env: VectorEnv[Array, Array, Array],
    agent: Agent,
    observation: Array,
    info: dict[str, Any],
    parts: Mapping[str, Part],
    watch: Watch,
) -> Loop:
    """Ask an agent once a control period from a reset to the horizon; the loop only looks on.

    Raises:
        ValueError: the agent raises an error, which is the cause of this one.
    """
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    n = env.num_envs
    loop = Loop(n, task.substeps, {"plant": Part(np.empty((0, n)), sample=_follow), **parts})
    observed = observation.shape[1] == task.observation_space.shape[0] + 4  # type: ignore[index]
    hold = getattr(env.unwrapped, "hold", None)

    def estimate() -> Array:
        return observation[:, -4:].T if observed else np.full((4, n), np.nan)

    loop.start(_EVERY, info["state"].T)
    loop.xhat[:], loop.y[:] = estimate(), observation[:, :2].T
    watch.look(0, loop)
    failed = np.zeros(n, dtype=np.bool_)
    unit = task.actuator.unit  # agents say newtons
    first, agent_state = np.ones(n, dtype=np.bool_), None
    later = ~first
    failures = 0
    reference = np.zeros((task.substeps + 1 if "desired" in info else 0, 4))
    for k in range(1, task.steps + 1):
        seen = np.where(failed[:, None], 0.0, observation) if failures else observation
        try:
            action, agent_state = agent.predict(seen, agent_state, first, True)
        except Exception as error:  # whatever a user's agent may raise
            place = f"t = {(k - 1) * task.control_period:g} s"
            raise ValueError(f"{title(agent)}: cannot act at {place} ({type(error).__name__}: {error})") from error
        action, first = action / unit, later
        if failures:
            action = np.where(failed[:, None], 0.0, action)
        observation, loop.reward[:], ended, _, info = env.step(action)
        loop.alive[:] = ~failed
        loop.x[:] = info["state"].T
        loop.xhat[:] = np.where(failed, loop.xhat, estimate()) if failures else estimate()
        loop.u[:] = info["asked"]
        if "desired" in info:
            reference[1:, :2] = info["desired"][np.argmin(failed)]  # of a slot whose time goes on
        loop.run(0, 1, reference, recording=np.ascontiguousarray(info["positions"].transpose(1, 2, 0)))
        loop.y[:] = observation[:, :2].T
        lost = diverged(observation) | info.get("estimate_failed", False)
        if hold is not None and np.count_nonzero(lost):
            hold(lost)
        failed = failed | ended.astype(np.bool_, copy=False) | lost
        watch.look(k, loop)
        if k % 100 == 0:
            watch.progress(100)
        failures = int(np.count_nonzero(failed))
        if failures == n and not watch.recorders:
            break
    watch.progress(task.steps % 100)
    loop.failed[:] = failed
    return loop
