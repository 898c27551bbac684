"""Numbers over random plants with 95 % intervals, bootstrapped over plants: what is of one plant stays together."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..typing import Array

RESAMPLES = 2000
_TAILS = (2.5, 97.5)


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number and its 95 % interval; of algebra it has none."""

    number: float
    low: float = math.nan
    high: float = math.nan

    @property
    def bounds(self) -> tuple[float, float]:
        """What the number lies between: itself where there is no interval."""
        return (self.low, self.high) if math.isfinite(self.low) else (self.number, self.number)


Statistic = Callable[..., Array]
"""Of arrays (..., rows, plants) to (...)."""


def estimate(statistic: Statistic, *values: Array, size: int | None = None) -> Estimate:
    """A statistic with its interval, the percentiles of resampled plants.

    Args:
        statistic: of all values.
        *values: (rows, plants) each, the same plants.
        size: resample so many plants in place of all: where a study of so many would find it.
    """
    n = values[0].shape[-1]
    number = float(statistic(*values)) if n else math.nan
    if n < 2:
        return Estimate(number)
    drawn = np.random.default_rng(0).integers(n, size=(RESAMPLES, size or n))
    low, high = np.percentile(statistic(*(np.moveaxis(each[:, drawn], 0, 1) for each in values)), _TAILS)
    return Estimate(number, float(low), float(high))


def reduction(without: Array, compensated: Array) -> Array:
    """By how much the mean is less with compensation, in percent."""
    return np.asarray(100.0 * (1.0 - compensated.mean((-2, -1)) / without.mean((-2, -1))))


def root_reduction(without: Array, compensated: Array) -> Array:
    """The same of roots of the means."""
    return np.asarray(100.0 * (1.0 - np.sqrt(compensated.mean((-2, -1)) / without.mean((-2, -1)))))


def mean_reduction(without: Array, compensated: Array) -> Array:
    """The mean of the rows' reductions, as Table 5 averages them."""
    return np.asarray(100.0 * (1.0 - (compensated.mean(-1) / without.mean(-1)).mean(-1)))


def better(without: Array, compensated: Array) -> Array:
    """The share of runs in which it is less with compensation, in percent."""
    return np.asarray(100.0 * (compensated < without).mean((-2, -1)))


def ratio(above: Array, below: Array) -> Array:
    """Of two means."""
    return np.asarray(above.mean((-2, -1)) / below.mean((-2, -1)))


def mean(values: Array) -> Array:
    """The mean."""
    return np.asarray(values.mean((-2, -1)))


def median(values: Array) -> Array:
    """The median."""
    return np.asarray(np.median(values, (-2, -1)))
