"""Laws of a comparison: their settings, what is tuned for which family of cases, and where numbers come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from inspect import signature
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from ..controllers import (
    LQR,
    IntegralSlidingMode,
    Linear,
    ModelPredictive,
    Reaching,
    SlidingModeController,
    SurfaceControl,
)
from ..controllers.reaching import PI
from ..plant import CartPendulum
from ..validation import choice
from . import configs, reading
from .candidates import merged
from .law_cases import LIMIT, MEASURED, TRACKING, Estimate, Law
from .settings import Name, Setting, Strict


def _weighed(
    Q: Any, R: float, dt: float, limit: float, plant: CartPendulum, model: CartPendulum | None = None
) -> Linear:
    return Linear(LQR.design(Q, R, plant).K[0], dt, limit=limit, model=model)


LAWS: dict[str, Callable[..., Any]] = {
    "linear": Linear,
    "lqr": _weighed,
    "smc": SlidingModeController,
    "surface": SurfaceControl,
    "integral-sliding-mode": IntegralSlidingMode,
    "mpc": ModelPredictive,
}
"""What makes a law, by the name in a file. LQR is told by its weights."""


class LawCandidate(Strict):
    """A law, in a comparison under a name of its own."""

    title: Name
    law: str
    settings: dict[str, Any] = Field(default={})
    """What is chosen everywhere; ``nominal`` names another candidate."""
    at: dict[str, dict[str, Any]] = Field(default={})
    """What is chosen in a family of cases, over that."""
    tuned: dict[str, Setting[dict[str, Any]]] = Field(default={})
    """What was tuned, by family."""
    feedforward: bool = False
    """Whether it knows the reference's force."""
    on: str | None = None
    """The only observer that it is for."""
    period: float | None = None
    """Control period in s that it is tuned at, where the family's is too long for it."""
    slow: bool = False
    """Whether it only runs at the longer control period, on some of the plants."""

    @property
    def estimate(self) -> Estimate | None:
        """The same as an estimate."""
        return None if self.on is None else Estimate(self.on, MEASURED)

    @property
    def kind(self) -> str:
        """Which of the kinds that pictures tell apart: that of its law, and PI on a sliding variable."""
        linear = self.settings.get("reaching", {}).get("kind") == PI
        return PI if linear else self.law

    def acts(self, family: str) -> bool:
        """Whether it has gains for a family of cases."""
        return not (self.at or self.tuned) or family in {*self.at, *self.tuned} or bool(self.settings.get("nominal"))

    @field_validator("law")
    @classmethod
    def _known(cls, name: str) -> str:
        return choice("law", name, LAWS)


class Family(Strict):
    """Cases that a law has gains of its own for, and what tuning minimises there."""

    scales: tuple[float, float]
    """Mean squares of h in m^2 and of theta in rad^2 that count as 1."""
    norm: Annotated[float, Field(ge=1.0)] = 4.0
    """In which both are taken together: of a large one the larger counts."""
    smoothness: float = 0.1
    """Weight of the logarithm of the total variation."""
    runs: Annotated[int, Field(ge=1)] = 16
    """Training plants, which no table has."""


class Laws(Strict):
    """Laws that were tuned alike."""

    title: Name
    seed: Annotated[int, Field(ge=0)]
    """Of CMA-ES."""
    budget: Annotated[int, Field(ge=1)]
    """Evaluations that each law gets in each family."""
    families: dict[str, Family]
    laws: dict[str, LawCandidate]

    def __getitem__(self, name: str) -> LawCandidate:
        """A law by name.

        Raises:
            ValueError: there is none of this name.
        """
        return self.laws[choice("law", name, self.laws)]

    def of(self, name: str, family: str, tuned: Mapping[str, Any] | None = None) -> Law:
        """What makes a law for a family of cases, with other numbers than the tuned ones where some are given."""
        return partial(self._made, name, family, tuned)

    def _made(self, name: str, family: str, tuned: Mapping[str, Any] | None, period: float, model: CartPendulum) -> Any:
        candidate = self[name]
        kept = candidate.tuned.get(family)
        numbers = tuned if tuned is not None else kept.value if kept else {}
        given = merged(merged(candidate.settings, candidate.at.get(family, {})), numbers)
        if "nominal" in given:
            given["nominal"] = self._nominal(given["nominal"], family, period, model)
        if "reaching" in given:
            given["reaching"] = Reaching(**given["reaching"])
        make = LAWS[candidate.law]
        takes = signature(make).parameters
        here = {"dt": period, "limit": LIMIT, "model": model, "plant": model}
        if candidate.law in ("linear", "lqr") and not (candidate.feedforward and family.startswith(TRACKING)):
            del here["model"]  # which is for the reference's force alone
        return make(**{name: value for name, value in here.items() if name in takes}, **given)

    def _nominal(self, told: Any, family: str, period: float, model: CartPendulum) -> Any:
        """Another candidate by its name, or a linear law by its gain."""
        if isinstance(told, str):
            return self._made(told, family, None, period, model)
        ahead = model if family.startswith(TRACKING) else None
        return Linear(np.array(told["K"]), period, limit=LIMIT, model=ahead)


def named() -> Laws:
    """The laws that come with the package."""
    return reading.read(configs.path("laws"), Laws)
