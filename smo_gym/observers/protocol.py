"""What an observer is given and what it must answer."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ..loop import Part
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, Flags


class Estimator(Protocol):
    """An observer at work on n slots."""

    @property
    def xhat(self) -> Array:
        """The estimates [h, theta, h', theta'], (4, n), a copy."""
        ...

    def reset(self, slots: Flags, y: Array) -> None:
        """Start the marked slots, (n,), anew where the encoders say ``y`` = [h, theta], (2, n)."""
        ...

    def update(self, samples: Array, u: Array) -> None:
        """Bring ``xhat`` to the end of a control period.

        Args:
            samples: measured positions at its sampling instants, the last one at its end, (samples, 2, n).
            u: the force in N that was applied, (n,).
        """
        ...


@runtime_checkable
class SeesTruth(Protocol):
    """An estimator that is shown the plants' states: the oracle's alone."""

    def see(self, slots: Flags, x: Array) -> None:
        """Show the states ``x`` (4, n) of the marked slots, after each reset and update."""
        ...


class Observer(Protocol):
    """The settings of an observer, constant while it works."""

    def start(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Estimator:
        """An estimator of n slots for positions sampled every ``dt`` seconds and forces of at most ``force`` N.

        ``nominal`` is the plant without uncertainty, all that an observer may know of the plants.

        Raises:
            ValueError: the observer cannot work with these.
        """
        ...


@runtime_checkable
class Compiled(Protocol):
    """An observer whose work is a block, so that it runs inside of the compiled loop."""

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; arguments and errors as of :meth:`Observer.start`."""
        ...
