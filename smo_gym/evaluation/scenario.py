"""Scenarios: what is measured, with which settings, and where each setting comes from. One YAML file each."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar, get_args

import gymnasium
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..controllers import LQR, SlidingModeController
from ..envs.task import Task, applied_force
from ..observers import Gains, SlidingModeObserver
from ..plant import CartPendulum
from ..reference import Reference, ReferenceNotFound, minimum_energy, shipped
from ..theorem import OperatingSet, design, stable
from ..validation import number, unknown
from ..wrappers import VectorObserverWrapper
from . import agents, files
from .rollout import Agent, title

T = TypeVar("T")
Four = tuple[float, float, float, float]
Fraction = Annotated[float, Field(ge=0.0, lt=1.0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Setting(_Strict, Generic[T]):
    """A value and its source."""

    value: T
    source: Literal["printed", "identified", "chosen"]
    note: str = ""


class ObserverSettings(_Strict):
    """The sliding mode observer that a controller's tables were made with; see there for the units."""

    gains: Setting[str | dict[str, tuple[float, float]]]
    slopes: Setting[tuple[float, float]]
    xhat0: Setting[Four]
    time_constant: Setting[float] = Setting[float](value=0.0, source="chosen")
    step: Setting[float | None] = Setting[float | None](value=None, source="chosen")

    def build(self, compensation: bool) -> SlidingModeObserver:
        """The observer with the compensation on or off."""
        return SlidingModeObserver(
            gains=self.gains.value,
            slopes=self.slopes.value,
            xhat0=self.xhat0.value,
            time_constant=self.time_constant.value,
            step=self.step.value,
            compensation=compensation,
        )


class LqrSettings(_Strict):
    """u = -K xhat."""

    law: Literal["lqr"]
    K: Setting[Four]
    wrap: Setting[bool] = Setting[bool](value=True, source="chosen", note="error of the angle within half a turn")
    observer: ObserverSettings

    def build(self, dt: float) -> LQR:
        """The controller."""
        return LQR(self.K.value, self.wrap.value)


class SmcSettings(_Strict):
    """Equations (49)-(50)."""

    law: Literal["smc"]
    k: Setting[Four]
    slope: Setting[float]
    Z0: Setting[float]
    lam: Setting[float]
    epsilon: Setting[float]
    wrap: Setting[bool] = Setting[bool](value=True, source="chosen", note="error of the angle within half a turn")
    observer: ObserverSettings

    def build(self, dt: float) -> SlidingModeController:
        """The controller for a control period of ``dt`` seconds."""
        return SlidingModeController(
            self.k.value, dt, self.slope.value, self.Z0.value, self.lam.value, self.epsilon.value, self.wrap.value
        )


class PolicySettings(_Strict):
    """An agent by its name for :func:`smo_gym.evaluation.agents.load`."""

    law: Literal["policy"]
    agent: str
    observer: ObserverSettings

    def build(self, environment: str) -> Agent:
        """The agent for an environment, made anew."""
        return agents.load(self.agent, environment)


ControllerSettings = Annotated[LqrSettings | SmcSettings | PolicySettings, Field(discriminator="law")]


class OperatingSetSettings(_Strict):
    """Bounds of states and estimates, and the level of uncertainty."""

    theta: Setting[float]
    speed: Setting[tuple[float, float]]
    uncertainty: Setting[Fraction]


class DesignSettings(_Strict):
    """An observer whose gains satisfy (28), (30) and (31) over an operating set."""

    operating_set: OperatingSetSettings
    margin: Setting[float]
    slopes: Setting[tuple[float, float]]
    force: Setting[float]

    def over(self, model: CartPendulum) -> OperatingSet:
        """The operating set; estimated velocities follow an injection of at most m1, and are given a margin more."""
        one = self.operating_set
        reach = (1.0 + self.margin.value) ** 2 * math.hypot(*one.speed.value)
        return OperatingSet(one.theta.value, one.speed.value, (reach, reach), one.uncertainty.value, model)

    def build(self, dt: float, model: CartPendulum) -> SlidingModeObserver:
        """The observer, with a step that it is stable at for the declared force."""
        return stable(design(self.over(model), self.margin.value), self.slopes.value, dt, self.force.value)


class TheoremSettings(DesignSettings):
    """The runs that test a design: ``agents/theorem.py``."""

    starts: Setting[tuple[Four, Four]]
    horizon: Setting[float]
    settle: Setting[float]
    gains: Setting[dict[str, tuple[float, float]]] | None = None

    @model_validator(mode="after")
    def _check(self) -> TheoremSettings:
        low, high = self.starts.value
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"starts: low={low} is above high={high}: the set of initial states holds no point")
        if not 0.0 <= self.settle.value < self.horizon.value:
            raise ValueError(f"settle={self.settle.value} must lie between 0 and horizon={self.horizon.value}")
        if self.gains is not None:
            Gains.of(self.gains.value)
        return self


class ReferenceSettings(_Strict):
    """The minimum-energy reference of a tracking scenario, from its initial state, over its horizon."""

    end: Setting[Four]
    force_limit: Setting[float]
    elements: Setting[Annotated[int, Field(ge=1)]]


class Scenario(_Strict):
    """One table: its environment, its rows (uncertainty levels times initial states) and its controllers.

    ``suffix`` is what the published data appends to a controller's name.
    """

    table: str
    title: str
    suffix: str = ""
    environment: str
    control_period: Setting[float]
    horizon: Setting[float]
    force_limit: Setting[float | None]
    track_limit: Setting[float | None]
    uncertainty: Setting[Annotated[tuple[Fraction, ...], Field(min_length=1)]]
    initial_states: Setting[Annotated[dict[str, Four], Field(min_length=1)]]
    controllers: Annotated[dict[str, ControllerSettings], Field(min_length=1)]
    designed: DesignSettings | None = None
    reference: ReferenceSettings | None = None

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
    def options(self) -> dict[str, Any]:
        """Options of the environment."""
        tracking = {} if self.reference is None else {"reference": self.trajectory(), "preview": 0}
        return {
            **tracking,
            "control_period": self.control_period.value,
            "horizon": self.horizon.value,
            "force_limit": self.force_limit.value,
            "track_limit": self.track_limit.value,
        }

    def agent(self, controller: str) -> Agent:
        """A controller, made anew."""
        settings = self.controllers[controller]
        if isinstance(settings, PolicySettings):
            return settings.build(self.environment)
        return settings.build(self.control_period.value)

    def period(self, agent: Agent) -> float:
        """An agent's control period in s: its attribute ``control_period`` where it has one, else the scenario's.

        Raises:
            ValueError: the attribute is no positive number.
        """
        value = getattr(agent, "control_period", self.control_period.value)
        return number(f"{title(agent)}.control_period", value, above=0.0)

    def with_agent(self, name: str) -> Scenario:
        """The same with one controller more, on the estimates of LQR's observer (or the first controller's).

        Args:
            name: for :func:`smo_gym.evaluation.agents.load`.

        Raises:
            ValueError: there is no such agent, or it cannot act here.
            ImportError: an extra is missing.
        """
        others = list(self.controllers.values())
        like = next((one for one in others if one.law == "lqr"), others[0])
        settings = PolicySettings(law="policy", agent=name, observer=like.observer)
        more = self.model_copy(update={"controllers": {**self.controllers, name: settings}})
        _try_controller(more, name)
        return more


def load_theorem(path: Path) -> TheoremSettings:
    """Read and validate the settings of ``agents/theorem.py``.

    Raises:
        ValueError: as :func:`load`.
    """
    try:
        return TheoremSettings.model_validate(_read(path, ()))
    except ValidationError as error:
        raise ValueError(f"{path}: " + "; ".join(_explain(e, TheoremSettings) for e in error.errors())) from None


@cache
def _reference(x0: Four, end: Four, horizon: float, force_limit: float, elements: int) -> Reference:
    """The shipped reference where it is the one, else the solver's."""
    ours = shipped()
    if (x0, end, horizon, force_limit, elements) == (ours.x0, ours.xT, ours.horizon, ours.force_limit, len(ours.u)):
        return ours
    return minimum_energy(x0, end, horizon, force_limit, elements)


def load(path: Path) -> Scenario:
    """Read and validate a scenario; ``extends: FILE`` starts from another file beside it.

    Raises:
        ValueError: the file cannot be read, is no YAML, or has an unknown, missing or bad value, named with its place.
    """
    data = _read(path, ())
    try:
        scenario = Scenario.model_validate(data)
        _try(scenario)
    except ValidationError as error:
        raise ValueError(f"{path}: " + "; ".join(_explain(e) for e in error.errors())) from None
    except (ValueError, TypeError, ImportError, ReferenceNotFound, gymnasium.error.Error) as error:
        raise ValueError(f"{path}: {error}") from None
    return scenario


def _try(scenario: Scenario) -> None:
    """Make everything once, so that a value that is not allowed is noticed before any run."""
    if scenario.reference is not None and len(scenario.initial_states.value) != 1:
        raise ValueError("initial_states must hold one state: a reference begins at one")
    for name in scenario.controllers:
        _try_controller(scenario, name)
    if scenario.designed is not None:
        env = gymnasium.make_vec(scenario.environment, 1, **scenario.options)
        task: Task = env.unwrapped.task  # type: ignore[attr-defined]
        VectorObserverWrapper(env, scenario.designed.build(task.dt, task.params))


def _try_controller(scenario: Scenario, name: str) -> None:
    """Two slots' first forces from a controller."""
    agent = scenario.agent(name)
    options = {**scenario.options, "control_period": scenario.period(agent)}
    env = gymnasium.make_vec(scenario.environment, 2, **options)
    observation, _ = VectorObserverWrapper(env, scenario.controllers[name].observer.build(True)).reset(seed=0)
    try:
        action, _ = agent.predict(observation, None, np.ones(2, dtype=np.bool_), True)
        applied_force(action, 2, math.inf)
    except Exception as error:  # whatever a user's agent may raise
        place = f"{scenario.environment} on observations of shape {observation.shape}"
        raise ValueError(f"{name}: cannot act in {place} ({type(error).__name__}: {error})") from error


def _read(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    if path.resolve() in above:
        raise ValueError(f"{path}: extends itself")
    data = files.read_yaml(path)
    if not isinstance(data, dict):
        raise ValueError(f"{path}: must be a mapping of settings")
    base = data.pop("extends", None)
    if base is None:
        return data
    if not isinstance(base, str):
        raise ValueError(f"{path}: extends={base!r} must be the name of a file")
    if not (path.parent / base).exists():
        raise ValueError(
            f"{path}: extends {base}, which is not beside it: copy that file too, or give the whole path to it"
        )
    return _merged(_read(path.parent / base, (*above, path.resolve())), data)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """``over`` on top of ``base``; a setting, which has a value, is replaced as a whole."""
    both = {
        key: _merged(base[key], value)
        for key, value in over.items()
        if isinstance(value, dict) and isinstance(base.get(key), dict) and "value" not in value
    }
    return {**base, **over, **both}


def _explain(error: Any, kind: type[BaseModel] = Scenario) -> str:
    place = [str(part) for part in error["loc"]]
    if error["type"] == "extra_forbidden":
        return f"{'.'.join(place)}: {unknown('setting', place[-1], _fields(place[:-1], kind))}"
    given = "" if error["type"] == "missing" else f" (given {error['input']!r})"
    return f"{'.'.join(place)}: {error['msg']}{given}"


def _fields(place: list[str], kind: type[BaseModel]) -> list[str]:
    """The settings that exist at a place of the configuration."""
    kinds: list[Any] = [kind]
    for part in place:
        found: list[Any] = []
        for kind in kinds:
            field = getattr(kind, "model_fields", {}).get(part)
            found += _models(field.annotation) if field is not None else [kind]  # a name or a tag: stay
        kinds = found
    return sorted({name for kind in kinds for name in getattr(kind, "model_fields", {})})


def _models(annotation: Any) -> list[Any]:
    """All models inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]
