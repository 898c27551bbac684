"""All runs that tables need: paired, in as few batches as there are controllers and environments."""

from __future__ import annotations

import builtins
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from reprlib import repr as short
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..envs.task import Task
from ..loop import runs_as_part
from ..observers import Compiled, Observer
from ..plant import STATE_NAMES
from ..typing import Array, Flags
from ..wrappers import VectorObserverWrapper
from . import metrics
from .arms import arm
from .draws import deviations, noise
from .pieces import Keeper, Map, cut
from .rollout import rollout
from .scenario import ControllerSettings, Scenario
from .settings import Four
from .traces import Traces

TRACED_RUNS = 10
"""Most runs of a group that are traced, the first ones: as many as the article shows."""
MOST_RUNS = 10_000_000
MOST_SECONDS = 1_000_000_000
"""Most simulated seconds of a study, over all runs: days of computing."""


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
        """The settings of its controller."""
        return self.scenario.controllers[self.controller]

    @property
    def start(self) -> Four:
        """The state that its runs begin in."""
        return self.scenario.starts(self.controller)[self.case]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the runs of a group gave: run r of every group has the same draw of the plant."""

    group: Group
    metrics: dict[str, Array]
    """Values (runs,) by the metric's name."""
    failed: Flags
    """Which runs failed, (runs,)."""
    traces: Traces | None = None
    """Traces of the first :data:`TRACED_RUNS` runs, where :func:`measure` was asked for them."""
    plants: Array | None = None
    """The runs' plants [M_c, m, l, g] in kg, kg, m and m/s^2, (runs, 4)."""
    refused: Array | None = None
    """When in s a run ended at a disturbance that was not finite, (runs,), 0 in the others; None of a store's."""

    @property
    def left(self) -> Flags | None:
        """Which runs left the operating set that an arm's gains are designed for, (runs,); None in other arms.

        None, too, where the plants are disturbed, which the set knows nothing of.
        """
        designed = self.group.scenario.designed
        if designed is None or not arm(self.group.arm).designed or self.group.scenario.task.disturbance:
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
    """All groups of some scenarios, with the nominal plant (0 %) beside the scenarios' own levels.

    That is one run, or as many as of the others where noise, friction or a disturbance differ from run to run.

    Raises:
        ValueError: an unknown arm; one of designed gains is wanted of a scenario that says nothing of them; or more
            runs than can be done.
    """
    scenarios = list(scenarios)
    for chosen in map(arm, arms):
        for scenario in scenarios:
            chosen.check(scenario)
    random = {id(scenario) for scenario in scenarios if scenario.options and scenario.task.random}
    found = [
        Group(scenario, controller, level, case, name, runs if level > 0.0 or id(scenario) in random else 1)
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


@dataclass(frozen=True, slots=True)
class Piece:
    """Groups that run as one batch, wherever that is."""

    indices: tuple[int, ...]
    """Where its groups stand among all groups of the study."""
    groups: tuple[Group, ...]
    options: dict[str, Any]
    """Options of the environment that its groups share."""
    seed: int
    samples: int | None
    meters: tuple[metrics.Meter, ...]
    """Ours that are measured; those of a user's modules come with these."""


Found = tuple[tuple[int, ...], list[Outcome]]
"""What a piece gave, and where it belongs."""


def measure(
    wanted: Sequence[Group],
    seed: int,
    progress: Callable[[float], object] = lambda seconds: None,
    samples: int | None = None,
    *,
    map: Map = builtins.map,
    store: Keeper | None = None,
) -> list[Outcome]:
    """Run all groups that are not kept. How they are cut, where they run and what is kept does not change a bit.

    Args:
        wanted: the groups; those that share environment, controller and kind of observer are batches.
        seed: of the plants.
        progress: called with the simulated seconds (over all slots) done since the last call.
        samples: trace the first runs of each group at about so many instants (at least so many, where an episode has
            them, and fewer than twice as many); None traces nothing.
        map: how pieces are run; function and pieces can be pickled.
        store: keeps every group as soon as its piece is done, and gives those of before.

    Raises:
        ValueError: ``samples`` is no positive integer.
    """
    if samples is not None and samples < 1:
        raise ValueError(f"samples={samples!r} must be a positive integer")
    keys = [store.key(group, seed, samples) if store else None for group in wanted]
    outcomes: dict[int, Outcome] = {}
    for index, key in enumerate(keys):
        kept = store.get(key, wanted[index]) if store and key else None
        if kept is not None:
            outcomes[index] = kept
    progress(simulated_seconds(outcome.group for outcome in outcomes.values()))
    here = map is builtins.map  # only here can it be told what a piece has done before it is done
    run = partial(run_piece, progress=progress) if here else run_piece
    for indices, found in map(run, _pieces(wanted, frozenset(outcomes), seed, samples)):
        for index, outcome in zip(indices, found, strict=True):
            group, key = wanted[index], keys[index]
            outcomes[index] = replace(outcome, group=group)
            if store and key and store.key(group, seed, samples) == key:  # no file that it names has changed meanwhile
                store.put(key, outcomes[index])
        if not here:
            progress(simulated_seconds(wanted[index] for index in indices))
    return [outcomes[index] for index in range(len(wanted))]


def run_piece(piece: Piece, progress: Callable[[float], object] = lambda seconds: None) -> Found:
    """Run a piece of work of :func:`measure`."""
    with metrics.measuring(piece.meters):
        found = _run(piece.groups, piece.options, piece.seed, progress, piece.samples)
    return piece.indices, [replace(each, traces=each.traces.in_rows() if each.traces else None) for each in found]


def _pieces(wanted: Sequence[Group], done: Collection[int], seed: int, samples: int | None) -> Iterator[Piece]:
    """What is left to do, cut as if nothing were done: pieces are the same ones, however often a study was stopped."""
    options = {id(group.scenario): group.scenario.environment_options for group in wanted}

    meters = tuple(meter for meter in metrics.METERS.values() if meter.finish.__module__.startswith("smo_gym."))
    kinds = [
        (group.scenario.environment, repr(options[id(group.scenario)]), repr(group.settings), observer)
        for group, observer in zip(wanted, _observers(wanted), strict=True)
    ]
    for piece in cut(kinds, [group.runs for group in wanted]):
        if left := tuple(index for index in piece if index not in done):
            groups = tuple(wanted[index] for index in left)
            yield Piece(left, groups, options[id(groups[0].scenario)], seed, samples, meters)


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
    return Compiled if runs_as_part(observer, "start") else id(observer)


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
    keys = noise(seed, len(draws)) if task.random else []
    states, plants, observers = [], [], []
    for group in batch:
        observer: Any = arm(group.arm).observer(group.settings.observer, group.scenario, task)
        for draw in draws[: group.runs]:
            states.append(group.start)
            plants.append(nominal.perturbed(group.uncertainty * draw).as_array())
            observers.append(observer)
    observed = VectorObserverWrapper(env, observers)
    edges = np.cumsum([group.runs for group in batch])[:-1]
    slots = [part[:TRACED_RUNS] for part in np.split(np.arange(n), edges)]
    params = np.array(plants)
    noises = {"noise": np.concatenate([keys[: group.runs] for group in batch])} if keys else {}
    result = rollout(
        observed,
        agent,
        options={"state": np.array(states), "params": params, **noises},
        trace_every=None if samples is None else max(task.steps // samples, 1),
        trace_slots=np.concatenate(slots).tolist(),
        progress=lambda steps: progress(steps * dt * n),
    )
    failed, refused = np.split(result.failed, edges), np.split(result.refused, edges)
    columns = {name: np.split(values, edges) for name, values in result.metrics.items()}
    traces = result.traces.split([len(part) for part in slots]) if result.traces else [None] * len(batch)
    return [
        Outcome(
            group,
            {name: parts[i] for name, parts in columns.items()},
            failed[i],
            traces[i],
            params[slots[i]],
            refused[i],
        )
        for i, group in enumerate(batch)
    ]
