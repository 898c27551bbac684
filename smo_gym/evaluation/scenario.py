"""Scenarios: what is measured, with which settings, and where each setting comes from. One YAML file each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..controllers import LQR, SlidingModeController
from ..observers import SlidingModeObserver
from ..validation import unknown

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
    """The sliding mode observer that a controller's tables were made with."""

    gains: Setting[str]
    slopes: Setting[tuple[float, float]]
    xhat0: Setting[Four]

    def build(self, compensation: bool) -> SlidingModeObserver:
        """The observer with the compensation on or off."""
        return SlidingModeObserver(
            gains=self.gains.value, slopes=self.slopes.value, xhat0=self.xhat0.value, compensation=compensation
        )


class LqrSettings(_Strict):
    """u = -K xhat."""

    law: Literal["lqr"]
    K: Setting[Four]
    observer: ObserverSettings

    def build(self, dt: float) -> LQR:
        """The controller."""
        return LQR(self.K.value)


class SmcSettings(_Strict):
    """Equations (49)-(50)."""

    law: Literal["smc"]
    k: Setting[Four]
    slope: Setting[float]
    Z0: Setting[float]
    lam: Setting[float]
    epsilon: Setting[float]
    observer: ObserverSettings

    def build(self, dt: float) -> SlidingModeController:
        """The controller for a control period of ``dt`` seconds."""
        return SlidingModeController(
            self.k.value, dt, self.slope.value, self.Z0.value, self.lam.value, self.epsilon.value
        )


ControllerSettings = Annotated[LqrSettings | SmcSettings, Field(discriminator="law")]


class Scenario(_Strict):
    """One table: its environment, its rows (uncertainty levels times initial states) and its controllers."""

    table: str
    title: str
    environment: str
    control_period: Setting[float]
    horizon: Setting[float]
    force_limit: Setting[float | None]
    track_limit: Setting[float | None]
    uncertainty: Setting[tuple[Fraction, ...]]
    initial_states: Setting[dict[str, Four]]
    controllers: dict[str, ControllerSettings]

    @property
    def options(self) -> dict[str, Any]:
        """Options of the environment."""
        return {
            "control_period": self.control_period.value,
            "horizon": self.horizon.value,
            "force_limit": self.force_limit.value,
            "track_limit": self.track_limit.value,
        }


def load(path: Path) -> Scenario:
    """Read and validate a scenario; ``extends: FILE`` starts from another file beside it.

    Raises:
        ValueError: the file cannot be read, is no YAML, or has an unknown, missing or bad value, named with its place.
    """
    data = _read(path)
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ValueError(f"{path}: " + "; ".join(_explain(e) for e in error.errors())) from None


def _read(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except yaml.YAMLError as error:
        raise ValueError(f"{path}: is no YAML ({' '.join(str(error).split())})") from None
    if not isinstance(data, dict):
        raise ValueError(f"{path}: must be a mapping of settings")
    base = data.pop("extends", None)
    return data if base is None else _merged(_read(path.parent / base), data)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """``over`` on top of ``base``; a setting, which has a value, is replaced as a whole."""
    both = {
        key: _merged(base[key], value)
        for key, value in over.items()
        if isinstance(value, dict) and isinstance(base.get(key), dict) and "value" not in value
    }
    return {**base, **over, **both}


def _explain(error: Any) -> str:
    place = [str(part) for part in error["loc"]]
    if error["type"] == "extra_forbidden":
        return f"{'.'.join(place)}: {unknown('setting', place[-1], _fields(place[:-1]))}"
    given = "" if error["type"] == "missing" else f" (given {error['input']!r})"
    return f"{'.'.join(place)}: {error['msg']}{given}"


def _fields(place: list[str]) -> list[str]:
    """The settings that exist at a place of the configuration."""
    kinds: list[Any] = [Scenario]
    for part in place:
        found = []
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
