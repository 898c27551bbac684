"""What an observer is given and what it must answer."""

from typing import NamedTuple, Protocol

from ..plant import CartPendulum
from ..typing import Array, Flags


class Period(NamedTuple):
    """One control period of n slots as a real observer sees it, and the truth for an oracle."""

    y: Array
    """Measured positions [h, theta] at its start, (2, n)."""
    samples: Array
    """Measured positions at each later sampling instant, the last one at its end, (samples, 2, n)."""
    u: Array
    """The force in N that was applied, (n,)."""
    truth: Array
    """The plants' states at its end, (4, n). Only an oracle reads it."""


class Estimator(Protocol):
    """An observer at work on n slots."""

    @property
    def xhat(self) -> Array:
        """The estimates [h, theta, h', theta'], (4, n), a copy."""
        ...

    def reset(self, slots: Flags, truth: Array) -> None:
        """Start the marked slots, (n,), anew. Only an oracle reads the plants' states ``truth``, (4, n)."""
        ...

    def update(self, period: Period) -> None:
        """Bring ``xhat`` to the end of a control period."""
        ...


class Observer(Protocol):
    """The settings of an observer, constant while it works."""

    def start(self, n: int, dt: float, force: float, nominal: CartPendulum) -> Estimator:
        """An estimator of n slots for positions sampled every ``dt`` seconds and forces of at most ``force`` N.

        ``nominal`` is the plant without uncertainty, all that an observer may know of the plants.

        Raises:
            ValueError: the observer cannot work with these.
        """
        ...
