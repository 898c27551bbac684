"""Laws that were tuned for what a policy is rewarded for, where it learns, on what it is told, as often as it acts."""

from __future__ import annotations

from functools import cache
from typing import ClassVar

from ..controllers import Feedback
from ..evaluation import law_settings
from ..evaluation.law_settings import Laws
from ..loop import Part
from ..plant import CartPendulum
from ..typing import Array, Flags

PERIOD = 0.02
"""Control period in s of the policies."""
TITLES = {"linear": "tuned linear law", "ism-super-twisting": "tuned integral sliding mode"}
"""In the learning table, by the name in ``configs/laws.yaml``."""


@cache
def _laws() -> Laws:
    return law_settings.named()


class Rival:
    """One of the laws on one kind of estimate, an agent."""

    control_period = PERIOD
    law: ClassVar[str]
    observation: ClassVar[str]

    def __init__(self) -> None:
        self._law: Feedback = _laws().of(self.law, f"learning-{self.observation}")(PERIOD, CartPendulum())

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """As of the law."""
        return self._law.predict(observation, state, episode_start, deterministic)

    def part(self, n: int) -> Part:
        """As of the law."""
        return self._law.part(n)


class LinearOnSmo(Rival):
    """The linear law on ``smo``."""

    law, observation = "linear", "smo"


class LinearOnSmoUncompensated(Rival):
    """The linear law on ``smo-uncompensated``."""

    law, observation = "linear", "smo-uncompensated"


class LinearOnState(Rival):
    """The linear law on ``state``."""

    law, observation = "linear", "state"


class SlidingOnSmo(Rival):
    """The integral sliding mode on ``smo``."""

    law, observation = "ism-super-twisting", "smo"


class SlidingOnSmoUncompensated(Rival):
    """The integral sliding mode on ``smo-uncompensated``."""

    law, observation = "ism-super-twisting", "smo-uncompensated"


class SlidingOnState(Rival):
    """The integral sliding mode on ``state``."""

    law, observation = "ism-super-twisting", "state"


RIVALS: tuple[type[Rival], ...] = (
    LinearOnSmo,
    LinearOnSmoUncompensated,
    LinearOnState,
    SlidingOnSmo,
    SlidingOnSmoUncompensated,
    SlidingOnState,
)
