"""Scenarios: what is measured, with which settings, and where each setting comes from. One YAML file each."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from pydantic import Field, field_validator, model_validator

from .. import files
from ..controllers import Agent, title
from ..envs.stepping import checked_force
from ..envs.task import Task
from ..reference import Reference, ReferenceNotFound, minimum_energy, shipped
from ..typing import Array
from ..validation import limit, number
from ..wrappers import VectorObserverWrapper
from . import configs, reading
from .formats import is_number, line
from .settings import (
    LONGEST_PERIOD,
    ControllerSettings,
    DesignSettings,
    Four,
    Fraction,
    Horizon,
    Name,
    OptionSettings,
    Period,
    PolicySettings,
    ReferenceSettings,
    Setting,
    Settings,
    States,
    TheoremSettings,
)

MOST_SUBSTEPS = 10_000
"""Most integration steps in a control period: all of their instants are in memory at once."""
__all__ = ["ControllerSettings", "Scenario", "Setting", "TheoremSettings", "entered", "load", "load_theorem", "named"]


class Scenario(Settings):
    """One table: its environment, its rows (uncertainty levels times initial states) and its controllers.

    ``suffix`` is what the published data appends to a controller's name; ``options`` go to the environment as they are.
    """

    table: Name
    title: Name
    suffix: Name = ""
    environment: Name
    control_period: Setting[Period]
    horizon: Setting[Horizon]
    force_limit: Setting[float | None]
    track_limit: Setting[float | None]
    uncertainty: Setting[Annotated[tuple[Fraction, ...], Field(min_length=1)]]
    initial_states: Setting[States]
    controllers: Annotated[dict[Name, ControllerSettings], Field(min_length=1)]
    designed: DesignSettings | None = None
    reference: ReferenceSettings | None = None
    options: OptionSettings = Field(default_factory=dict)

    @field_validator("environment")
    @classmethod
    def _registered(cls, name: str) -> str:
        module, colon, rest = name.rpartition(":")
        if colon:
            raise ValueError(
                f"a file may not name a module to import: say {rest!r}, and --import {module} on the command line (in "
                f"Python: import {module})"
            )
        return name

    @model_validator(mode="after")
    def _bounds(self) -> Scenario:
        for name in ("control_period", "horizon"):
            number(name, getattr(self, name).value, above=0.0)
        for name in ("force_limit", "track_limit"):
            limit(name, getattr(self, name).value)
        return self

    @model_validator(mode="after")
    def _columns(self) -> Scenario:
        cases = self.initial_states.value
        if "average" in cases:
            raise ValueError("initial_states: 'average' is the name of another row: take another")
        for what, names in (("initial_states", cases), ("controllers", self.controllers)):
            if len({line(name).upper() for name in names}) < len(names):
                raise ValueError(f"{what}: of the names {', '.join(map(repr, names))} two look the same")
            if len({is_number(name) for name in names if name}) > 1:
                raise ValueError(f"{what}: of the names {', '.join(map(repr, names))} all or none must be numbers")
        for name, settings in self.controllers.items():
            settings.check_starts(name, cases)
        return self

    def starts(self, controller: str) -> dict[str, Four]:
        """The initial states of a controller's runs by their names: its own where it has them."""
        return (self.controllers[controller].initial_states or self.initial_states).value

    def from_one_start(self) -> Scenario:
        """The scenario without controllers' own initial states, to compare them with each other."""
        alike = {name: each.model_copy(update={"initial_states": None}) for name, each in self.controllers.items()}
        return self.model_copy(update={"controllers": alike})

    def trajectory(self) -> Reference | None:
        """The reference to follow: the shipped one where it answers to these settings, else solved for.

        Raises:
            ImportError: it must be solved for, and CasADi is missing.
            ReferenceNotFound: there is none.
        """
        if self.reference is None:
            return None
        (x0,) = self.initial_states.value.values()
        settings = self.reference
        wanted = (x0, settings.end.value, self.horizon.value, settings.force_limit.value, settings.elements.value)
        return _reference(*wanted)

    @property
    def environment_options(self) -> dict[str, Any]:
        """All options of the environment."""
        tracking = {} if self.reference is None else {"reference": self.trajectory(), "preview": 0}
        return {
            **tracking,
            **{name: setting.value for name, setting in self.options.items()},
            "control_period": self.control_period.value,
            "horizon": self.horizon.value,
            "force_limit": self.force_limit.value,
            "track_limit": self.track_limit.value,
        }

    def with_options(self, note: str = "", **values: Any) -> Scenario:
        """The scenario with further options of the environment, chosen ones, such as ``sensor="encoders"``.

        Raises:
            ValueError: an option is unknown, or its value is not allowed.
        """
        chosen = {name: {"value": value, "source": "chosen", "note": note} for name, value in values.items()}
        more = reading.validated({**dict(self), "options": {**self.options, **chosen}}, Scenario)
        more.make()
        return more

    def make(self) -> VectorEnv[Array, Array, Array]:
        """One slot of the environment, to ask and to try things in.

        Raises:
            ValueError: an option is unknown, or its value is not allowed.
        """
        try:
            return gymnasium.make_vec(self.environment, 1, **self.environment_options)
        except (ValueError, TypeError, ArithmeticError) as error:
            given = f"with options.{', options.'.join(self.options)}: " if self.options else ""
            raise ValueError(f"{given}{error}") from error

    @property
    def task(self) -> Task:
        """What the environment makes of the options; ``task.params`` is the nominal plant."""
        task: Task = self.make().unwrapped.task  # type: ignore[attr-defined]
        return task

    def agent(self, controller: str) -> Agent:
        """A controller, made anew."""
        settings = self.controllers[controller]
        if isinstance(settings, PolicySettings):
            return settings.build(self.environment)
        return settings.build(self.control_period.value)

    def period(self, agent: Agent) -> float:
        """An agent's control period in s: its attribute ``control_period`` where it has one, else the scenario's.

        Raises:
            ValueError: the attribute is no positive number, or a longer time than the scenario's may be.
        """
        name = f"{title(agent)}.control_period"
        value = number(name, getattr(agent, "control_period", self.control_period.value), above=0.0)
        if value > LONGEST_PERIOD:
            raise ValueError(f"{name}={value:g} must be at most {LONGEST_PERIOD:g} s")
        return value

    def with_agent(self, name: str) -> Scenario:
        """The scenario with one controller more, on the estimates of LQR's observer (or the first controller's).

        All begin alike then, as in :meth:`from_one_start`.

        Args:
            name: any for :func:`smo_gym.policies.named.load`, also those that a file may not name.

        Raises:
            ValueError: there is no such agent, or it cannot act here.
            ImportError: an extra is missing.
        """
        others = list(self.controllers.values())
        like = next((controller for controller in others if controller.law == "lqr"), others[0])
        settings = PolicySettings.model_construct(law="policy", agent=name, observer=like.observer)
        more = self.model_copy(update={"controllers": {**self.controllers, name: settings}}).from_one_start()
        _try_controller(more, name)
        return more


def entered(scenarios: Sequence[Scenario], agent: str) -> tuple[list[Scenario], list[str]]:
    """The scenarios with an agent where it can act, and a line for each other.

    Raises:
        ValueError: it can act in none.
        ImportError: an extra is missing.
    """
    reasons: dict[str, str] = {}

    def enter(scenario: Scenario) -> Scenario:
        try:
            return scenario.with_agent(agent)
        except ValueError as error:
            reasons[scenario.title] = str(error)
            return scenario

    more = [enter(scenario) for scenario in scenarios]
    if len(reasons) == len(scenarios):
        raise ValueError("; ".join(dict.fromkeys(reasons.values())))
    return more, [f"left out of {title}: {reason}" for title, reason in reasons.items()]


def load_theorem(path: Path) -> TheoremSettings:
    """Read and validate the settings of ``smo-gym theorem``.

    Raises:
        ValueError: the file cannot be read, is no YAML, or has an unknown, missing or bad value, named with its place.
    """
    return reading.read(path, TheoremSettings)


@cache
def _reference(x0: Four, end: Four, horizon: float, force_limit: float, elements: int) -> Reference:
    """The shipped reference where it is the one, else the solver's."""
    ours = shipped()
    if (x0, end, horizon, force_limit, elements) == (ours.x0, ours.xT, ours.horizon, ours.force_limit, len(ours.u)):
        return ours
    return minimum_energy(x0, end, horizon, force_limit, elements)


def load(path: Path, wanted: Collection[str] = ("all",)) -> Scenario:
    """Read and validate a scenario; ``extends: FILE`` starts from another file beside it, or from one of ours.

    Args:
        path: of the YAML file.
        wanted: the policies that are going to run, by name or law; no other one's files are opened.

    Raises:
        ValueError: the file cannot be read, is no YAML, or has an unknown, missing or bad value, named with its place.
    """
    scenario = reading.read(path, Scenario)
    try:
        _try(scenario, wanted)
    except (ValueError, TypeError, ArithmeticError, ImportError, ReferenceNotFound, gymnasium.error.Error) as error:
        raise ValueError(f"{path}: {files.shortened(str(error))}") from None
    return scenario


def named(name: str) -> Scenario:
    """One of the scenarios that come with the package, such as regulation or tracking.

    Raises:
        ValueError: there is none of this name.
    """
    return load(configs.path(name))


def _try(scenario: Scenario, wanted: Collection[str]) -> None:
    """Make everything once, so that a value that is not allowed is noticed before any run."""
    if scenario.reference is not None and len(scenario.initial_states.value) != 1:
        raise ValueError("initial_states must hold one state: a reference begins at one")
    env = scenario.make()
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    if "dt" in scenario.options and task.substeps > MOST_SUBSTEPS:
        raise ValueError(f"options.dt={task.dt:g} is less than a {MOST_SUBSTEPS:,}th of the control period")
    for name, settings in scenario.controllers.items():
        if settings.law != "policy" or {name, settings.law, "all"} & {*wanted}:
            _try_controller(scenario, name)
    if scenario.designed is not None:
        VectorObserverWrapper(env, scenario.designed.build(task.dt, task.params))


def _try_controller(scenario: Scenario, name: str) -> None:
    """Two slots' first forces from a controller."""
    agent = scenario.agent(name)
    options = {**scenario.environment_options, "control_period": scenario.period(agent)}
    env = gymnasium.make_vec(scenario.environment, 2, **options)
    observation, _ = VectorObserverWrapper(env, scenario.controllers[name].observer.build(True)).reset(seed=0)
    try:
        action, _ = agent.predict(observation, None, np.ones(2, dtype=np.bool_), True)
        checked_force(action, 2)
    except Exception as error:  # whatever a user's agent may raise
        place = f"{scenario.environment} on observations of shape {observation.shape}"
        raise ValueError(f"{name}: cannot act in {place} ({type(error).__name__}: {error})") from error
