"""Interquartile means of scores and what they say of two contenders, with bootstrap intervals.

The interquartile mean leaves out the best and the worst quarter of the runs (Agarwal et al., Deep Reinforcement
Learning at the Edge of the Statistical Precipice, NeurIPS 2021). Two things are drawn at random: training seeds and
plants. So both are drawn anew with replacement, a seed with all its plants, a plant with all its policies and levels:
runs of one policy are not taken for independent, as a bootstrap over single runs would. Levels of uncertainty are
strata: "over all levels" is the mean of their interquartile means, so that none is trimmed away as a whole.

A percentile interval from n seeds is too narrow: from five it covers 89 % where it says 95. So where a policy has
learned, both halves are widened by :func:`widening`, on the logarithmic scale (a probability's on its own, within
[0, 1]); then it covers 95 % against a law and more against another policy, as simulated in
tests/learning/test_contest.py. It widens the plants' share too, which is on the safe side. Below :data:`SEEDS`
intervals are shown and decide nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t, trim_mean

from ..typing import Array
from .contest import Scores

Indices = NDArray[np.intp]

try:
    from arch.bootstrap import IndependentSamplesBootstrap
except ImportError as error:
    raise ImportError('bootstrap intervals need arch: pip install "smo_gym[rl]"') from error

REPETITIONS = 2000
SEEDS = 5
"""Training seeds that a verdict needs; chosen. From fewer, an interval of two equals leaves out 1 far too often."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number and its 95 % interval, NaN where there is none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """One contender against another."""

    a: Scores
    b: Scores
    ratio: Estimate
    """Ratio a / b of the means over all levels of the interquartile means: below 1 where a is the better."""
    probability: Estimate
    """Probability that a has the lower score on the same plant, a draw counted half, over all pairs of policies."""

    @property
    def verdict(self) -> str:
        """The answer to whether a beats b."""
        if any(scores.contender.cards and len(scores.values) < SEEDS for scores in (self.a, self.b)):
            return "open: a verdict needs five training seeds"
        if math.isnan(self.ratio.low):
            return "open: an interval needs at least two plants a level"
        if self.ratio.high < 1.0:
            more = self.a.failed.mean() > self.b.failed.mean()
            return "yes, of the runs that stand; it fails more often" if more else "yes"
        return "no, it is worse" if self.ratio.low > 1.0 else "undecided"


def widening(seeds: int) -> float:
    """Student's quantile over the normal one, and the bootstrap's variance with n in place of n - 1 put right."""
    return float(t.ppf(0.975, seeds - 1) / norm.ppf(0.975) * math.sqrt(seeds / (seeds - 1)))


def interquartile_means(scores: Scores) -> list[Estimate]:
    """Interquartile mean of a contender's scores at each level, and last the mean of these over all levels."""

    def means(policies: Indices, plants: Indices) -> Array:
        levels = _level_means(scores.values[policies][:, :, plants])
        return np.array([*levels, levels.mean()])

    policies, _, plants = scores.values.shape
    return [_wider(estimate, scores) for estimate in _estimates(means, [policies, plants], _few(scores))]


def compare(a: Scores, b: Scores) -> Comparison:
    """Whether a beats b, over all levels."""

    def both(of_a: Indices, of_b: Indices, plants: Indices) -> Array:
        x, y = a.values[of_a][:, :, plants], b.values[of_b][:, :, plants]
        lower = np.mean(x[:, None] < y) + 0.5 * np.mean(x[:, None] == y)
        return np.array([_level_means(x).mean() / _level_means(y).mean(), lower])

    sizes = [len(a.values), len(b.values), a.values.shape[2]]
    ratio, probability = _estimates(both, sizes, _few(a) or _few(b))
    return Comparison(a, b, _wider(ratio, a, b), _wider(probability, a, b, within_one=True))


def _level_means(values: Array) -> Array:
    """Each level's interquartile mean, of scores (policies, levels, plants)."""
    return np.array([trim_mean(level, 0.25, axis=None) for level in values.swapaxes(0, 1)])


def _few(scores: Scores) -> bool:
    """Whether a learned contender has too few seeds for an interval."""
    return bool(scores.contender.cards) and len(scores.values) < 2


def _wider(estimate: Estimate, *scores: Scores, within_one: bool = False) -> Estimate:
    """An interval for the fewest seeds that anything in it was learned from."""
    seeds = [len(each.values) for each in scores if each.contender.cards]
    if not seeds or math.isnan(estimate.low):
        return estimate
    factor = widening(min(seeds))
    if within_one:
        low, high = (estimate.value + factor * (end - estimate.value) for end in (estimate.low, estimate.high))
        return Estimate(estimate.value, max(low, 0.0), min(high, 1.0))
    return Estimate(
        estimate.value, *(estimate.value * (end / estimate.value) ** factor for end in (estimate.low, estimate.high))
    )


def _estimates(function: Callable[..., Array], sizes: Sequence[int], few: bool) -> list[Estimate]:
    indices = [np.arange(size) for size in sizes]
    values = function(*indices)
    if few or sizes[-1] < 2:
        return [Estimate(value, math.nan, math.nan) for value in values.tolist()]
    low, high = IndependentSamplesBootstrap(*indices, seed=0).conf_int(function, REPETITIONS, method="percentile")
    return [Estimate(*three) for three in zip(values.tolist(), low.tolist(), high.tolist(), strict=True)]
