"""All runs that tables need: paired, in as few batches as there are controllers and environments."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from reprlib import repr as short
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..envs.task import Task
from ..observers import Compiled, Observer
from ..plant import STATE_NAMES
from ..typing import Array, Flags
from ..wrappers import VectorObserverWrapper
from .arms import arm
from .rollout import rollout
from .scenario import ControllerSettings, Scenario
from .traces import Traces

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
        arm(self.arm)

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
        """Which runs left the operating set that an arm's gains are designed for, (runs,); None in other arms."""
        designed = self.group.scenario.designed
        if designed is None or not arm(self.group.arm).designed:
            return None
        zero = np.zeros_like(self.metrics["peak_theta"])
        x, xhat = (
            np.array([zero, *(self.metrics[f"{peak}_{name}"] for name in STATE_NAMES[1:])])
            for peak in ("peak", "peak_estimate")
        )
        return ~designed.over(self.group.scenario.task.params).holds(x, xhat) | (
            self.metrics["peak_force"] > designed.force.value
        )


def groups(scenarios: Iterable[Scenario], controllers: Sequence[str], arms: Sequence[str], runs: int) -> list[Group]:
    """All groups of some scenarios, with the nominal plant (0 %, one run) beside the scenarios' own levels.

    Raises:
        ValueError: an unknown arm; one of designed gains is wanted of a scenario that says nothing of them; or more
            runs than can be done.
    """
    scenarios = list(scenarios)
    for chosen in map(arm, arms):
        for scenario in scenarios:
            chosen.check(scenario)
    found = [
        Group(scenario, controller, level, case, name, runs if level > 0.0 else 1)
        for scenario in scenarios
        for controller in controllers
        if controller in scenario.controllers
        for level in sorted({0.0, *scenario.uncertainty.value})
        for case in scenario.initial_states.value
        for name in arms
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
    options = {id(group.scenario): group.scenario.environment_options for group in wanted}
    batches: dict[Any, list[int]] = {}
    for index, (group, observer) in enumerate(zip(wanted, _observers(wanted), strict=True)):
        scenario = group.scenario
        key = (scenario.environment, repr(options[id(scenario)]), repr(group.settings), observer)
        batches.setdefault(key, []).append(index)
    outcomes: dict[int, Outcome] = {}
    for indices in batches.values():
        batch = [wanted[i] for i in indices]
        found = _run(batch, options[id(batch[0].scenario)], seed, progress, samples)
        outcomes.update(zip(indices, found, strict=True))
    return [outcomes[index] for index in range(len(wanted))]


def _observers(wanted: Iterable[Group]) -> list[Hashable]:
    """What kind of observer each group has: equal for those that can share a batch.

    Raises:
        ValueError: an arm's observer cannot work in a scenario.
    """
    envs: dict[int, VectorEnv[Array, Array, Array]] = {}
    found: dict[tuple[int, str, str], Observer] = {}
    places = []
    for group in wanted:
        scenario = group.scenario
        places.append((id(scenario), group.controller, group.arm))
        if id(scenario) not in envs:
            envs[id(scenario)] = scenario.make()
        if places[-1] not in found:
            found[places[-1]] = arm(group.arm).tried(group.settings.observer, scenario, envs[id(scenario)])
    return [_kind(found[place]) for place in places]


def _kind(observer: Observer) -> Hashable:
    """Compiled observers of all kinds share a batch; others, asked once a control period, are alone in theirs."""
    return Compiled if isinstance(observer, Compiled) else id(observer)


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
    scenario = batch[0].scenario
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
        observer: Any = arm(group.arm).observer(group.settings.observer, group.scenario, task)
        for draw in draws[: group.runs]:
            states.append(group.scenario.initial_states.value[group.case])
            plants.append(nominal.perturbed(group.uncertainty * draw).as_array())
            observers.append(observer)
    observed = VectorObserverWrapper(env, observers)
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
