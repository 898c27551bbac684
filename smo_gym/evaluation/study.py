"""All runs that tables need: paired, in as few batches as there are controllers and environments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from reprlib import repr as short
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..envs.task import Task
from ..plant import STATE_NAMES, CartPendulum
from ..typing import Array, Flags
from ..validation import choice
from ..wrappers import VectorObserverWrapper
from .rollout import rollout
from .scenario import ControllerSettings, Scenario
from .traces import Traces

ARMS = ("without", "with", "theorem", "oracle")
"""Compensation of the input uncertainty off, on; gains designed for the theorem; the true state for an estimate."""
TRACED_RUNS = 10
"""Of each group at most so many runs are traced, the first ones: as many as the article shows."""
MOST_RUNS = 10_000_000
MOST_SECONDS = 1_000_000_000
"""Simulated: days of computing."""


@dataclass(frozen=True, slots=True)
class Group:
    """The runs of one controller from one initial state at one level of uncertainty with one observer."""

    scenario: Scenario
    controller: str
    uncertainty: float
    case: str
    arm: str
    runs: int

    def __post_init__(self) -> None:
        choice("arm", self.arm, ARMS)

    @property
    def name(self) -> str:
        """What the published data calls its controller."""
        return self.controller + self.scenario.suffix

    @property
    def settings(self) -> ControllerSettings:
        """Of its controller."""
        return self.scenario.controllers[self.controller]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the runs of a group gave: run r of every group has the same draw of the plant."""

    group: Group
    metrics: dict[str, Array]
    """Metric name to values (runs,)."""
    failed: Flags
    """(runs,)."""
    traces: Traces | None = None
    """Of its first :data:`TRACED_RUNS` runs, where :func:`measure` was asked for them."""
    plants: Array | None = None
    """[M_c, m, l, g] of these runs, (runs, 4)."""

    @property
    def left(self) -> Flags | None:
        """Which runs left the operating set that the theorem's gains are designed for, (runs,); None in other arms."""
        designed = self.group.scenario.designed
        if self.group.arm != "theorem" or designed is None:
            return None
        zero = np.zeros_like(self.metrics["peak_theta"])
        x, xhat = (
            np.array([zero, *(self.metrics[f"{peak}_{name}"] for name in STATE_NAMES[1:])])
            for peak in ("peak", "peak_estimate")
        )
        return ~designed.over(CartPendulum()).holds(x, xhat) | (self.metrics["peak_force"] > designed.force.value)


def groups(scenarios: Iterable[Scenario], controllers: Sequence[str], arms: Sequence[str], runs: int) -> list[Group]:
    """All groups of some scenarios, with the nominal plant (0 %, one run) beside the scenarios' own levels.

    Raises:
        ValueError: an unknown arm; one of designed gains is wanted of a scenario that says nothing of them; or more
            runs than can be done.
    """
    scenarios = list(scenarios)
    for arm in arms:
        choice("arm", arm, ARMS)
    for scenario in scenarios:
        if "theorem" in arms and scenario.designed is None:
            raise ValueError(f"scenario {scenario.title!r} has no setting 'designed' for the theorem's gains")
        if "theorem" in arms and max(scenario.uncertainty.value) > scenario.designed.operating_set.uncertainty.value:  # type: ignore[union-attr]
            raise ValueError(
                f"uncertainty={scenario.uncertainty.value} is beyond what the theorem's gains are designed for"
            )
    found = [
        Group(scenario, controller, level, case, arm, runs if level > 0.0 else 1)
        for scenario in scenarios
        for controller in controllers
        if controller in scenario.controllers
        for level in sorted({0.0, *scenario.uncertainty.value})
        for case in scenario.initial_states.value
        for arm in arms
    ]
    if sum(group.runs for group in found) > MOST_RUNS or simulated_seconds(found) > MOST_SECONDS:
        raise ValueError(
            f"runs={short(runs)}: in all {MOST_RUNS:,} runs and {MOST_SECONDS:,} simulated seconds are the most: take "
            "fewer runs, levels or initial states, or a shorter horizon"
        )
    return found


def deviations(seed: int, runs: int) -> Array:
    """What multiplies the level of uncertainty in M_c, m and l, U(-1, 1), (runs, 3).

    Run r's draw depends on the seed and r alone, so more runs add to those that were there.
    """
    return np.array([np.random.default_rng([seed, run]).uniform(-1.0, 1.0, 3) for run in range(runs)])


def measure(
    wanted: Sequence[Group],
    seed: int,
    progress: Callable[[float], object] = lambda seconds: None,
    samples: int | None = None,
) -> list[Outcome]:
    """Run all groups.

    Args:
        wanted: the groups; those that share environment, controller and kind of observer are one batch.
        seed: of the plants.
        progress: called with the simulated seconds (over all slots) done since the last call.
        samples: trace the first runs of each group at about so many instants (at least so many, where an episode has
            them, and fewer than twice as many); None traces nothing.

    Raises:
        ValueError: ``samples`` is no positive integer.
    """
    if samples is not None and samples < 1:
        raise ValueError(f"samples={samples!r} must be a positive integer")
    options = {id(group.scenario): group.scenario.options for group in wanted}
    batches: dict[Any, list[int]] = {}
    for index, group in enumerate(wanted):
        scenario = group.scenario
        key = (scenario.environment, repr(options[id(scenario)]), repr(group.settings), _together(group.arm))
        batches.setdefault(key, []).append(index)
    outcomes: dict[int, Outcome] = {}
    for indices in batches.values():
        batch = [wanted[i] for i in indices]
        found = _run(batch, options[id(batch[0].scenario)], seed, progress, samples)
        outcomes.update(zip(indices, found, strict=True))
    return [outcomes[index] for index in range(len(wanted))]


def _together(arm: str) -> str:
    """Arms that can share a batch: their observers have one step."""
    return "smo" if arm in ("without", "with") else arm


def simulated_seconds(wanted: Iterable[Group]) -> float:
    """The total that :func:`measure` reports to its ``progress``."""
    return sum(group.runs * group.scenario.horizon.value for group in wanted)


def _run(
    batch: Sequence[Group],
    options: dict[str, Any],
    seed: int,
    progress: Callable[[float], object],
    samples: int | None,
) -> list[Outcome]:
    scenario, settings = batch[0].scenario, batch[0].settings
    agent = scenario.agent(batch[0].controller)
    dt = scenario.period(agent)
    n = sum(group.runs for group in batch)
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        scenario.environment, n, autoreset_mode=AutoresetMode.DISABLED, **{**options, "control_period": dt}
    )
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    nominal = task.params
    draws = deviations(seed, max(group.runs for group in batch))
    states, plants, observers = [], [], []
    for group in batch:
        if group.arm == "theorem":
            assert scenario.designed is not None  # groups() has seen to it
            observer = scenario.designed.build(task.dt, nominal)
        else:
            observer = settings.observer.build(group.arm == "with")
        for draw in draws[: group.runs]:
            states.append(group.scenario.initial_states.value[group.case])
            plants.append(nominal.perturbed(group.uncertainty * draw).as_array())
            observers.append(observer)
    observed = VectorObserverWrapper(env, "oracle" if batch[0].arm == "oracle" else observers)
    edges = np.cumsum([group.runs for group in batch])[:-1]
    slots = [part[:TRACED_RUNS] for part in np.split(np.arange(n), edges)]
    params = np.array(plants)
    result = rollout(
        observed,
        agent,
        options={"state": np.array(states), "params": params},
        trace_every=None if samples is None else max(task.steps // samples, 1),
        trace_slots=np.concatenate(slots).tolist(),
        progress=lambda steps: progress(steps * dt * n),
    )
    failed = np.split(result.failed, edges)
    columns = {name: np.split(values, edges) for name, values in result.metrics.items()}
    traces = _split(result.traces, [len(part) for part in slots])
    return [
        Outcome(group, {name: parts[i] for name, parts in columns.items()}, failed[i], traces[i], params[slots[i]])
        for i, group in enumerate(batch)
    ]


def _split(traces: Traces | None, sizes: Sequence[int]) -> Sequence[Traces | None]:
    """Traces of all slots as one a group."""
    if traces is None:
        return [None] * len(sizes)
    of_slots = (traces.x, traces.xhat, traces.u, traces.u_low, traces.u_high, traces.u_mean)
    parts = (np.split(values, np.cumsum(sizes)[:-1], axis=-1) for values in of_slots)
    return [
        Traces(traces.time, x, xhat, u, low, high, mean, traces.x_d)
        for x, xhat, u, low, high, mean in zip(*parts, strict=True)
    ]
