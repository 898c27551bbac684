"""Arms of a comparison: the same runs on another observer's estimate. Tables, figures and commands read them here."""

from __future__ import annotations

import colorsys
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

from gymnasium.vector import VectorEnv

from ..article import WITH, WITHOUT
from ..envs.task import Task
from ..observers import Observer, Oracle
from ..typing import Array
from ..validation import choice
from ..wrappers import VectorObserverWrapper
from . import candidates
from .scenario import Scenario
from .settings import ObserverSettings

Made = Callable[[ObserverSettings, Scenario, Task], Observer]
"""An observer from the settings of the controller's own, the scenario, and the task, whose ``params`` are nominal."""
THEOREM, ORACLE = "theorem", "oracle"
PRINTED = (WITHOUT, WITH)
"""The article's arms: its observer with the compensation off and on."""
SMO, EVERY = "smo", "all"
"""What ``--observer`` calls the printed arms, and all."""
_NAME, _COLOUR = re.compile(r"\w[\w-]*"), re.compile(r"#[0-9A-Fa-f]{6}")


@dataclass(frozen=True, slots=True)
class Arm:
    """An arm of a comparison: which observer's estimate its runs are on, and how it is shown.

    Args:
        name: in files, tables and on the command line: letters, digits, "-" and "_".
        title: in figures and the report.
        colour: in the report, as "#RRGGBB".
        colour_on_dark: in the report on dark ground, as "#RRGGBB".
        observer: makes its observer.
        designed: it works from the scenario's setting ``designed``: that must be there and hold all levels of
            uncertainty, and runs that leave its operating set are counted.

    Raises:
        ValueError: a name or colour is not of this form.
    """

    name: str
    title: str
    colour: str
    colour_on_dark: str
    observer: Made
    designed: bool = False
    settings: str = ""
    """What its observer is made with besides, as text: a stored group depends on it."""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise ValueError(f"name={self.name!r} must be of letters, digits, '-' and '_'")
        for colour in ("colour", "colour_on_dark"):
            if not _COLOUR.fullmatch(getattr(self, colour)):
                raise ValueError(f"{colour}={getattr(self, colour)!r} must be as '#RRGGBB'")

    def check(self, scenario: Scenario) -> None:
        """See that the arm can run in a scenario.

        Raises:
            ValueError: it needs designed gains, and the scenario says nothing of them or has larger levels.
        """
        if not self.designed:
            return
        if scenario.designed is None:
            raise ValueError(f"scenario {scenario.title!r} has no setting 'designed' for the theorem's gains")
        if max(scenario.uncertainty.value) > scenario.designed.operating_set.uncertainty.value:
            raise ValueError(
                f"uncertainty={scenario.uncertainty.value} is beyond what the theorem's gains are designed for"
            )

    def tried(self, settings: ObserverSettings, scenario: Scenario, env: VectorEnv[Array, Array, Array]) -> Observer:
        """The arm's observer, after a start in an environment of the scenario's.

        Raises:
            ValueError: it cannot be made, or cannot work there.
        """
        try:
            observer = self.observer(settings, scenario, env.unwrapped.task)  # type: ignore[attr-defined]
            VectorObserverWrapper(env, observer)
        except Exception as error:  # whatever a user's observer may raise
            raise ValueError(
                f"arm {self.name!r}: its observer cannot work in {scenario.title!r} ({type(error).__name__}: {error})"
            ) from error
        return observer


ARMS: dict[str, Arm] = {}
"""All arms by name, in the tables' order."""


def register(arm: Arm) -> None:
    """Add an arm after those that are there.

    Raises:
        ValueError: its name or one of its colours is taken; the report tells arms apart by them.
    """
    names = (*ARMS, SMO, EVERY)
    if arm.name in names:
        raise ValueError(f"arm {arm.name!r} exists: take a name other than {', '.join(map(repr, names))}")
    taken = {colour.upper(): other.name for other in ARMS.values() for colour in (other.colour, other.colour_on_dark)}
    for colour in (arm.colour, arm.colour_on_dark):
        if colour.upper() in taken:
            raise ValueError(f"arm {arm.name!r}: the colour {colour} is taken by {taken[colour.upper()]!r}")
    ARMS[arm.name] = arm


def arm(name: str) -> Arm:
    """An arm by name.

    Raises:
        ValueError: there is none of this name, with a suggestion.
    """
    known = ARMS if name in ARMS else {**ARMS, **tuned()}
    return known[choice("arm", name, known)]


@cache
def tuned() -> dict[str, Arm]:
    """An arm for each observer that was tuned on simulated encoders, by name; none of them is in ``all``."""
    found = candidates.named("simulated").observers
    n = len(found)
    return {
        name: Arm(
            name,
            candidate.title,
            _hue(i / n, 0.35),
            _hue(i / n, 0.7),
            partial(_build, candidate),
            settings=candidate.model_dump_json(),
        )
        for i, (name, candidate) in enumerate(found.items())
    }


def _build(candidate: candidates.Candidate, settings: ObserverSettings, scenario: Scenario, task: Task) -> Observer:
    return candidate.build()


def _hue(hue: float, lightness: float) -> str:
    red, green, blue = colorsys.hls_to_rgb(hue, lightness, 0.6)
    return f"#{round(255 * red):02X}{round(255 * green):02X}{round(255 * blue):02X}"


def _designed(settings: ObserverSettings, scenario: Scenario, task: Task) -> Observer:
    assert scenario.designed is not None  # check() has seen to it
    return scenario.designed.build(task.dt, task.params)


_TRUE_STATE = Oracle()

# Colours after Okabe and Ito: told apart by the colour-blind.
register(Arm(WITHOUT, "without compensation", "#D55E00", "#F08A3C", lambda own, scenario, task: own.build(False)))
register(Arm(WITH, "with compensation", "#0072B2", "#56B4E9", lambda own, scenario, task: own.build(True)))
register(Arm(THEOREM, "theorem's gains", "#009E73", "#2CC295", _designed, designed=True))
register(Arm(ORACLE, "true state", "#B35C92", "#E39AC8", lambda own, scenario, task: _TRUE_STATE))
