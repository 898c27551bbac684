"""Settings of a scenario: values with their sources, and what is made of them."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated, Any, Generic, Literal, Self, TypeVar, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    field_serializer,
    field_validator,
    model_serializer,
    model_validator,
)

from ..controllers import LQR, Agent, SlidingModeController
from ..observers import Gains, SlidingModeObserver
from ..plant import CartPendulum
from ..policies import named
from ..presets import spelled
from ..theorem import OperatingSet, design, stable
from . import reading

T = TypeVar("T")
Four = tuple[float, float, float, float]
Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
State = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
"""A state [h, theta, h', theta'] in m, rad, m/s, rad/s."""
Start = Annotated[
    Annotated[State, Tag("state")] | Annotated[Literal["measured"], Tag("word")],
    Discriminator(lambda given: "word" if isinstance(given, str) else "state"),
]
"""Where an estimate begins: a state, or "measured" for [y(0), 0, 0]."""
Fraction = Annotated[float, Field(ge=0.0, lt=1.0)]
Name = Annotated[str, Field(max_length=200)]
States = Annotated[dict[Name, State], Field(min_length=1)]
"""Initial states by the names of their cases."""
Horizon = Annotated[float, Field(le=1e5)]
"""Length of a run in s, a day and more at most."""
LONGEST_PERIOD = 10.0
"""Longest control period in s: all of its instants are in memory at once."""
Period = Annotated[float, Field(le=LONGEST_PERIOD)]


SHORTEST_STEP = 1e-6
"""Shortest integration step of an observer in s."""
Step = Annotated[float, Field(ge=SHORTEST_STEP)]


class Strict(BaseModel):
    """Settings that refuse unknown names and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Setting(Strict, Generic[T]):
    """A value and its source."""

    value: T
    source: Literal["printed", "identified", "chosen"]
    note: str = ""

    @field_serializer("value", mode="wrap", when_used="json")
    def _spelled(self, value: Any, handler: SerializerFunctionWrapHandler) -> Any:
        return spelled(value) if callable(value) else handler(value)

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, which finds no class ``Setting[float]`` by its name."""
        return _again, (type(self).__name__, dict(self), self.model_fields_set)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        _KINDS[cls.__name__] = cls


_KINDS: dict[str, type[Setting[Any]]] = {}


def _again(name: str, values: dict[str, Any], given: set[str]) -> Setting[Any]:
    return _KINDS.get(name, Setting[Any]).model_construct(given, **values)


class Settings(Strict):
    """Settings that belong together, and names."""

    def changed(self, *, note: str = "", **values: Any) -> Self:
        """These settings with other values, chosen ones, checked as if a file had given them.

        Args:
            note: of the settings that change.
            **values: by the names of settings, such as ``horizon=5.0``; a name or title is given alike.

        Raises:
            ValueError: there is no setting of a name, or its value is not allowed.
        """
        kinds = {
            name: reading.models(field.annotation)
            for name, field in type(self).model_fields.items()
            if get_origin(field.annotation) is not dict  # of settings that each have a source
        }
        given = {
            name: {"value": value, "source": "chosen", "note": note}
            if any(issubclass(kind, Setting) for kind in kinds.get(name, ()))
            else value
            for name, value in values.items()
        }
        return reading.validated({**dict(self), **given}, type(self))


class ObserverSettings(Settings):
    """The sliding mode observer that a controller's tables were made with, its units as there."""

    gains: Setting[str | dict[str, tuple[float, float]]]
    slopes: Setting[tuple[float, float]]
    xhat0: Setting[Start]
    time_constant: Setting[float] = Setting[float](value=0.0, source="chosen")
    step: Setting[Step | None] = Setting[Step | None](value=None, source="chosen")

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


class OwnStart(Settings):
    """Where a controller's runs begin, if not in the scenario's initial states: by the same names, all of them."""

    initial_states: Setting[States] | None = None

    def check_starts(self, controller: str, cases: Collection[str]) -> None:
        """Whether they are those of a scenario's cases.

        Raises:
            ValueError: one is missing, or there is another.
        """
        own = None if self.initial_states is None else self.initial_states.value
        if own is not None and {*own} != {*cases}:
            given, known = (", ".join(map(repr, names)) for names in (own, cases))
            raise ValueError(f"controllers.{controller}.initial_states: names {given} must be the scenario's, {known}")

    @model_serializer(mode="wrap")
    def _unsaid(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        told: dict[str, Any] = handler(self)
        return {name: value for name, value in told.items() if name != "initial_states" or value is not None}


class LqrSettings(OwnStart):
    """Settings of LQR, u = -K xhat."""

    law: Literal["lqr"]
    K: Setting[Four]
    wrap: Setting[bool] = Setting[bool](value=True, source="chosen", note="error of the angle within half a turn")
    observer: ObserverSettings

    def build(self, dt: float) -> LQR:
        """The controller that these settings make."""
        return LQR(self.K.value, self.wrap.value)


class SmcSettings(OwnStart):
    """Settings of the sliding mode control, equations (49)-(50)."""

    law: Literal["smc"]
    k: Setting[Four]
    slope: Setting[float]
    Z0: Setting[float]
    lam: Setting[float]
    epsilon: Setting[float]
    wrap: Setting[bool] = Setting[bool](value=True, source="chosen", note="error of the angle within half a turn")
    observer: ObserverSettings

    def build(self, dt: float) -> SlidingModeController:
        """The controller that these settings make for a control period of ``dt`` seconds."""
        return SlidingModeController(
            self.k.value, dt, self.slope.value, self.Z0.value, self.lam.value, self.epsilon.value, self.wrap.value
        )


class PolicySettings(OwnStart):
    """An agent by its name for :func:`smo_gym.policies.named.load`: of those names, one that runs no code."""

    law: Literal["policy"]
    agent: str
    observer: ObserverSettings

    @field_validator("agent")
    @classmethod
    def _data(cls, name: str) -> str:
        if not named.is_data(name):
            raise ValueError(
                f"a file may name {named.SHIPPED} or PATH.safetensors alone; what runs code is named on the command "
                "line, as --controller PATH.zip or module:Class"
            )
        return name

    def build(self, environment: str) -> Agent:
        """The agent for an environment, made anew."""
        return named.load(self.agent, environment)


ControllerSettings = Annotated[LqrSettings | SmcSettings | PolicySettings, Field(discriminator="law")]


class OperatingSetSettings(Settings):
    """Bounds of states and estimates, and the level of uncertainty."""

    theta: Setting[float]
    speed: Setting[tuple[float, float]]
    uncertainty: Setting[Fraction]


class DesignSettings(Settings):
    """An observer whose gains satisfy (28), (30) and (31) over an operating set."""

    operating_set: OperatingSetSettings
    margin: Setting[float]
    slopes: Setting[tuple[float, float]]
    force: Setting[float]

    def over(self, model: CartPendulum) -> OperatingSet:
        """The operating set; estimated velocities follow an injection of at most m1, and are given a margin more."""
        settings = self.operating_set
        reach = (1.0 + self.margin.value) ** 2 * math.hypot(*settings.speed.value)
        return OperatingSet(
            settings.theta.value, settings.speed.value, (reach, reach), settings.uncertainty.value, model
        )

    def build(self, dt: float, model: CartPendulum) -> SlidingModeObserver:
        """The observer, with a step that it is stable at for the declared force.

        Raises:
            ValueError: the step would be too short to compute with.
        """
        observer = stable(design(self.over(model), self.margin.value), self.slopes.value, dt, self.force.value)
        if observer.step is not None and observer.step < SHORTEST_STEP:
            raise ValueError(
                f"slopes={self.slopes.value} and force={self.force.value:g} need a step of {observer.step:.3g} s in "
                f"the observer, less than {SHORTEST_STEP:g} s: take smaller ones"
            )
        return observer


class TheoremSettings(DesignSettings):
    """The runs that test a design: ``smo-gym theorem``."""

    starts: Setting[tuple[State, State]]
    horizon: Setting[Horizon]
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


ELSEWHERE = {
    **{name: name for name in ("control_period", "horizon", "force_limit", "track_limit", "reference", "uncertainty")},
    "initial_state": "initial_states",
}
"""Options of the environment that a scenario has settings of its own for, and which."""
OF_A_BATCH = ("num_envs", "vectorization_mode", "vector_kwargs", "wrappers", "autoreset_mode", "max_episode_steps")
"""What :func:`gymnasium.make_vec` takes for itself."""


def _for_a_task(options: dict[str, Setting[Any]]) -> dict[str, Setting[Any]]:
    for name in options:
        if name in ELSEWHERE:
            raise ValueError(f"{name!r} does not belong here: it is the scenario's own setting {ELSEWHERE[name]!r}")
        if name in (*OF_A_BATCH, "render_mode"):
            raise ValueError(f"{name!r} does not belong here: it is of how episodes are run, not of what they are")
    function = options["disturbance"].value if "disturbance" in options else None
    if isinstance(function, str) and ":" in function:
        raise ValueError(f"a file may not name code: say --disturbance {function} on the command line")
    return options


OptionSettings = Annotated[dict[Name, Setting[Any]], AfterValidator(_for_a_task)]
"""Further options of the environment, by name."""


class ReferenceSettings(Settings):
    """The minimum-energy reference of a tracking scenario, from its initial state, over its horizon."""

    end: Setting[State]
    force_limit: Setting[float]
    elements: Setting[Annotated[int, Field(ge=1, le=10_000)]]
