"""Learned and designed controllers, each on what it is allowed to know, on the same plants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..article import WITH, WITHOUT
from ..evaluation import study
from ..evaluation.arms import ORACLE
from ..evaluation.guard import DIVERGED
from ..evaluation.scenario import Scenario
from ..policies.frozen import Card, MlpPolicy
from ..typing import Array, Flags
from .rivals import RIVALS, TITLES

ALGORITHMS = {"ppo": "PPO", "recurrent": "RecurrentPPO"}
ARM_OF = {"smo": WITH, "smo-uncompensated": WITHOUT, "state": ORACLE}
"""Which observer stands for a kind of observation. Policies on positions do not look at the oracle."""
FAILED = 2.0 * DIVERGED**2
"""The score of a run that failed: the worst. No other run has more, since its h and theta stay below DIVERGED."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A controller on one kind of observation; of a learned one, several policies that differ in their seed alone."""

    controller: str
    observation: str
    names: tuple[str, ...]
    """Names of its policies' weights, or of the controller in the scenario."""
    cards: tuple[Card, ...] = ()

    @property
    def title(self) -> str:
        """The contender's name in tables, such as "PPO on smo"."""
        return f"{self.controller} on {self.observation}"


@dataclass(frozen=True, slots=True)
class Scores:
    """What a contender's runs gave: plant r of every contender, policy and level has the same draw."""

    contender: Contender
    values: Array
    """MSE of h in m^2 plus MSE of theta in rad^2, :data:`FAILED` where the run failed, (policies, levels, plants)."""
    failed: Flags
    """Which runs failed, (policies, levels, plants)."""


def trained(folders: Iterable[Path], environment: str) -> tuple[list[Contender], list[str]]:
    """The policies in some folders and below, by algorithm and kind of observation, and a line for each left out.

    Raises:
        ValueError: a folder without any, damaged files, a card that does not say what is to be known, or policies of
            one kind that differ in more than their seeds.
    """
    groups: dict[tuple[str, str], dict[int, tuple[str, Card]]] = {}
    left_out = []
    for folder in folders:
        paths = sorted(folder.rglob("policy.safetensors"))
        if not paths:
            raise ValueError(f"{folder}: holds no policy.safetensors, as python agents/train.py writes them to runs/")
        for path in paths:
            card = MlpPolicy.load(path).card
            if card.environment != environment:
                left_out.append(f"{path} is left out: it was trained for {card.environment}, not {environment}")
                continue
            algorithm = card.configuration.get("algorithm")
            if algorithm not in ALGORITHMS or card.seed is None:
                raise ValueError(
                    f"{path}: its card must say seed and configuration.algorithm ({' or '.join(ALGORITHMS)})"
                )
            seeds = groups.setdefault((ALGORITHMS[algorithm], card.observation), {})
            _alike(path, card, seeds)
            seeds[card.seed] = (str(path), card)
    if not groups:
        raise ValueError(f"no policy for {environment}: " + "; ".join(left_out))
    found = []
    for (algorithm, observation), seeds in sorted(groups.items()):
        names, cards = zip(*(seeds[seed] for seed in sorted(seeds)), strict=True)
        found.append(Contender(algorithm, observation, names, cards))
    return found, left_out


def _alike(path: Path, card: Card, seeds: dict[int, tuple[str, Card]]) -> None:
    for seed, (other, known) in seeds.items():
        if seed == card.seed:
            raise ValueError(f"{path} and {other} have the same seed, {seed}")
        here, there = ({k: v for k, v in either.configuration.items() if k != "seed"} for either in (card, known))
        if here != there:
            names = [name for name in here | there if here.get(name) != there.get(name)]
            raise ValueError(f"{path} and {other} differ in more than their seed: in {', '.join(names)}")


def designed(scenario: Scenario) -> list[Contender]:
    """The scenario's own controllers on each kind of estimate."""
    return [Contender(name.upper(), kind, (name,)) for name in scenario.controllers for kind in ARM_OF]


def rivals() -> list[Contender]:
    """Laws that were tuned for what the policies are rewarded for."""
    return [
        Contender(TITLES[rival.law], rival.observation, (f"{rival.__module__}:{rival.__qualname__}",))
        for rival in RIVALS
    ]


def entered(scenario: Scenario, contenders: Iterable[Contender]) -> Scenario:
    """The scenario with all contenders' policies, in which everyone begins at its initial state.

    Raises:
        ValueError: a policy cannot act in it, or it has several initial states.
    """
    if len(scenario.initial_states.value) != 1:
        raise ValueError(f"initial_states={list(scenario.initial_states.value)} must hold one state")
    scenario = scenario.from_one_start()
    for contender in contenders:
        for name in contender.names:
            scenario = scenario if name in scenario.controllers else scenario.with_agent(name)
    return scenario


def groups(scenario: Scenario, contender: Contender, runs: int) -> list[study.Group]:
    """The runs of a contender: policies times levels."""
    (case,) = scenario.initial_states.value
    arm = ARM_OF.get(contender.observation, ORACLE)
    levels = scenario.uncertainty.value
    return [study.Group(scenario, name, level, case, arm, runs) for name in contender.names for level in levels]


def measure(
    scenario: Scenario,
    contenders: Sequence[Contender],
    runs: int,
    seed: int,
    progress: Callable[[float], object] = lambda seconds: None,
    measured: Callable[..., list[study.Outcome]] = study.measure,
) -> list[Scores]:
    """Run all contenders on the same plants.

    Args:
        scenario: of :func:`entered`.
        contenders: who runs.
        runs: plants a level.
        seed: of the plants.
        progress: as in :func:`smo_gym.evaluation.study.measure`.
        measured: that function, or one like it that runs the groups elsewhere.
    """
    wanted = [groups(scenario, contender, runs) for contender in contenders]
    outcomes = iter(measured([group for part in wanted for group in part], seed, progress))
    found = []
    for contender, part in zip(contenders, wanted, strict=True):
        rows: list[Any] = [next(outcomes) for _ in part]
        shape = (len(contender.names), len(scenario.uncertainty.value), runs)
        failed = np.array([row.failed for row in rows]).reshape(shape)
        values = np.array([row.metrics["mse_h"] + row.metrics["mse_theta"] for row in rows]).reshape(shape)
        found.append(Scores(contender, np.where(failed, FAILED, values), failed))
    return found
