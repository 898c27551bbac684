"""One closed loop on a batch of plants, for every controller; metrics are summed up as it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gymnasium.vector import AutoresetMode, VectorEnv

from ..controllers import Agent
from ..disturbances import refused
from ..envs.vector import PendulumVectorEnv
from ..loop import runs_as_part
from ..typing import Array, Flags
from ..validation import short
from . import metrics
from .drivers import asked, driven, loop_inside
from .traces import Recorder, Tracer, Traces, Watch, forces


@dataclass(frozen=True, slots=True)
class Rollout:
    """What n runs gave."""

    metrics: dict[str, Array]
    """Metric name (:func:`smo_gym.evaluation.metrics.names`) to values (n,), over each run's own duration."""
    failed: Flags
    """Runs that terminated (off the track, fallen, not finite) or whose estimate diverged or was lost, (n,)."""
    traces: Traces | None
    refused: Array
    """When in s a run ended at a disturbance that was not finite, (n,); 0 in the others."""


def rollout(
    env: VectorEnv[Array, Array, Array],
    agent: Agent,
    *,
    seed: int | None = None,
    options: Mapping[str, Any] | None = None,
    trace_every: int | None = None,
    trace_slots: Sequence[int] | None = None,
    recorders: Sequence[Recorder] = (),
    progress: Callable[[int], object] = lambda steps: None,
) -> Rollout:
    """Run every slot of a vector environment from reset to its horizon.

    A slot that fails is held and counted; the others go on. A law with a ``part`` runs inside of the environment's
    compiled loop; any other agent is asked once a control period. The bits are the same.

    Args:
        env: a ``SMOPendulum`` vector environment, observed or not, with ``autoreset_mode=DISABLED``. It is left where
            it may be: reset it before it is used again.
        agent: chooses the force from the observation.
        seed: of the environment's reset.
        options: of the environment's reset, ``state`` and ``params`` to replay exact cases.
        trace_every: keep every so many control instants; None keeps none, and memory does not grow with time.
        trace_slots: the slots to keep them of; None for all.
        recorders: who looks on besides.
        progress: called with the number of control periods done since the last call.

    Raises:
        TypeError: the environment is another one, such as Gymnasium's vector environment of scalar ones.
        ValueError: the environment restarts slots by itself, ``trace_every`` is no positive integer, the agent raises
            an error, which is the cause of this one, or its force is not finite.
    """
    base = env.unwrapped
    if not isinstance(base, PendulumVectorEnv):
        raise TypeError(
            f"env={short(env)} is a {type(base).__name__}, it must be a SMOPendulum vector environment in one batch: "
            "make it by gymnasium.make_vec(..., vectorization_mode='vector_entry_point')"
        )
    if env.metadata.get("autoreset_mode") is not AutoresetMode.DISABLED:
        raise ValueError("a rollout is one episode a slot: make the environment with autoreset_mode='Disabled'")
    if trace_every is not None and trace_every < 1:
        raise ValueError(f"trace_every={trace_every!r} must be a positive integer")
    task = base.task
    tracer = None if trace_every is None else Tracer(trace_every, trace_slots, task)
    watch = Watch([*recorders, *([] if tracer is None else [tracer])], progress)
    n = env.num_envs
    parts = {name: meter.part(n) for name, meter in metrics.METERS.items()}
    if tracer is not None:
        parts["forces"] = forces(n)
    observation, info = env.reset(seed=seed, options=dict(options or {}))
    inner = None if "steps" in (options or {}) else loop_inside(env)  # these episodes do not end together
    if inner is not None and runs_as_part(agent, "predict"):
        loop = driven(inner, agent, parts, watch)
    else:
        loop = asked(env, agent, observation, info, parts, watch)
    found: dict[str, Array] = {}
    for name, meter in metrics.METERS.items():
        values = meter.finish(loop.own(name), task.control_period)
        found |= {metric.name: row for metric, row in zip(meter.metrics, values, strict=True)}
    pushed = loop if "disturbance" in loop.parts or not task.disturbance else base.loop
    return Rollout(found, loop.failed > 0.0, None if tracer is None else tracer.traces(), refused(pushed))
