"""One closed loop on a batch of plants, for every controller; metrics are accumulated as it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..controllers import Agent, title
from ..envs.desired import Desired
from ..envs.task import Task
from ..typing import Array, Flags
from . import metrics

# An observer of poor gains can diverge while its plant goes on. No estimate in m, rad, m/s, rad/s comes near this.
DIVERGED = 1e4


@dataclass(frozen=True, slots=True)
class Traces:
    """Some slots of a rollout at every so many control instants, the start included."""

    time: Array
    """s, (m,)."""
    x: Array
    """True states, (m, 4, n)."""
    xhat: Array
    """Estimates, (m, 4, n); NaN where the environment has no observer."""
    u: Array
    """Force in N over the control period that ended at ``time``, (m, n)."""
    u_low: Array
    """The least force in N since the instant before, (m, n): a force can chatter faster than what is kept of it."""
    u_high: Array
    """The largest, (m, n)."""
    u_mean: Array
    """The mean, (m, n): what such a force does to the cart."""
    x_d: Array | None
    """The reference, (m, 4), where there is one."""


@dataclass(frozen=True, slots=True)
class Rollout:
    """What n runs gave."""

    metrics: dict[str, Array]
    """Metric name (:data:`smo_gym.evaluation.metrics.NAMES`) to values (n,), over each run's own duration."""
    failed: Flags
    """Runs that terminated (off the track, fallen, not finite) or whose estimate diverged or was lost, (n,)."""
    traces: Traces | None


def rollout(
    env: VectorEnv[Array, Array, Array],
    agent: Agent,
    *,
    seed: int | None = None,
    options: Mapping[str, Any] | None = None,
    trace_every: int | None = None,
    trace_slots: Sequence[int] | None = None,
    progress: Callable[[int], object] = lambda steps: None,
) -> Rollout:
    """Run every slot of a vector environment from reset to its horizon.

    A slot that fails is held and counted; the others go on.

    Args:
        env: a ``SMOPendulum`` vector environment, observed or not, with ``autoreset_mode=DISABLED``.
        agent: chooses the force from the observation.
        seed: of the environment's reset.
        options: of the environment's reset, ``state`` and ``params`` to replay exact cases.
        trace_every: keep every so many control instants; None keeps none, and memory does not grow with time.
        trace_slots: the slots to keep them of; None for all.
        progress: called with the number of control periods done since the last call.

    Raises:
        ValueError: the environment restarts slots by itself, ``trace_every`` is no positive integer, or the agent
            raises an error, which is the cause of this one.
    """
    if env.metadata.get("autoreset_mode") is not AutoresetMode.DISABLED:
        raise ValueError("a rollout is one episode a slot: make the environment with autoreset_mode='Disabled'")
    if trace_every is not None and trace_every < 1:
        raise ValueError(f"trace_every={trace_every!r} must be a positive integer")
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    n = env.num_envs
    observation, info = env.reset(seed=seed, options=dict(options or {}))
    sums = metrics.start(n)
    told = task.observation_space.shape[0]  # type: ignore[index]  # without an observer
    observed = observation.shape[1] == told + 4

    def estimate() -> Array:
        return observation[:, -4:] if observed else np.full((n, 4), np.nan)

    trace = _Recorder(trace_every, trace_slots, task)
    trace.record(0, info, estimate())
    failed: Flags = np.zeros(n, dtype=np.bool_)
    first, agent_state = np.ones(n, dtype=np.bool_), None
    later = ~first
    failures = 0
    for k in range(1, task.steps + 1):
        seen = np.where(failed[:, None], 0.0, observation) if failures else observation
        try:
            action, agent_state = agent.predict(seen, agent_state, first, True)
        except Exception as error:  # whatever a user's agent may raise
            place = f"t = {(k - 1) * task.control_period:g} s"
            raise ValueError(f"{title(agent)}: cannot act at {place} ({type(error).__name__}: {error})") from error
        first = later
        if failures:
            action = np.where(failed[:, None], 0.0, action)
        observation, _, ended, _, info = env.step(action)
        metrics.add(sums, info, estimate(), failed)
        failed = failed | ended.astype(np.bool_, copy=False) | ~(np.abs(observation) < DIVERGED).all(axis=1)
        failed |= info.get("estimate_failed", False)
        trace.record(k, info, estimate())
        if k % 100 == 0:
            progress(100)
        failures = int(np.count_nonzero(failed))
        if failures == n:
            break
    progress(task.steps % 100)
    return Rollout(metrics.finish(sums, task.control_period), failed, trace.traces())


class _Recorder:
    def __init__(self, every: int | None, slots: Sequence[int] | None, task: Task) -> None:
        self._every, self._task = every, task
        self._slots = slice(None) if slots is None else np.asarray(slots, dtype=np.intp)
        self._rows: list[tuple[Array, ...]] = []
        self._start()

    def _start(self) -> None:
        self._low, self._high, self._sum, self._periods = np.array(np.inf), np.array(-np.inf), np.array(0.0), 0

    def record(self, k: int, info: dict[str, Any], xhat: Array) -> None:
        if self._every is None:
            return
        u = info["force"][self._slots]
        self._low, self._high = np.minimum(self._low, u), np.maximum(self._high, u)
        self._sum, self._periods = self._sum + u, self._periods + 1
        if k % self._every == 0:
            time, x = np.array(k * self._task.control_period), info["state"][self._slots].T
            mean = self._sum / self._periods
            self._rows.append((time, x, xhat[self._slots].T, u, self._low, self._high, mean))
            self._start()

    def traces(self) -> Traces | None:
        if self._every is None:
            return None
        time, x, xhat, u, low, high, mean = (np.array(column) for column in zip(*self._rows, strict=True))
        reference = self._task.reference
        told = None if reference is None else Desired(self._task, reference).states[:: self._every][: len(time)]
        return Traces(time, x, xhat, u, low, high, mean, told)
