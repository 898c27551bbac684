"""Velocities from the last two samples alone, as they are or through a low-pass."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.blocks import XHAT, Y0, Y, at, block, four, offsets, put_four, two
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import positive_pair
from .estimator import Compiling

PERIOD, CUTOFF, _ = offsets(1, 2)


@block
def _difference(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        (h0, theta0), (h, theta), period = two(signals, Y0, i), two(signals, Y, i), at(own, PERIOD, i)
        put_four(signals, XHAT, i, (h, theta, (h - h0) / period, (theta - theta0) / period))


@dataclass(frozen=True, slots=True)
class BackwardDifference(Compiling):
    """v_k = (y_k - y_{k-1}) / h: exact half a period late, and noise is divided by h."""

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any plant and force will do."""
        return Part(columns(n, dt), sample=_difference, period=PERIOD)


@block
def _filter(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        (h0, theta0), (h, theta), (_, _, v, omega) = two(signals, Y0, i), two(signals, Y, i), four(signals, XHAT, i)
        period, w = at(own, PERIOD, i), two(own, CUTOFF, i)
        v = (v + w[0] * (h - h0)) / (1.0 + w[0] * period)
        omega = (omega + w[1] * (theta - theta0)) / (1.0 + w[1] * period)
        put_four(signals, XHAT, i, (h, theta, v, omega))


@dataclass(frozen=True, slots=True)
class FilteredDerivative(Compiling):
    """The derivative through a low-pass, v' = cutoff (y' - v), by Euler's implicit step.

    ::

        v_k = (v_{k-1} + cutoff (y_k - y_{k-1})) / (1 + cutoff h)

    Args:
        cutoff: of each position's low-pass, in rad/s.

    Raises:
        ValueError: a cutoff is not positive.
    """

    cutoff: tuple[float, float] = (60.0, 60.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cutoff", positive_pair("cutoff", self.cutoff))

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots; any plant and force will do."""
        return Part(columns(n, dt, self.cutoff), sample=_filter, period=PERIOD)
