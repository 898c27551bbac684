"""How likely printed cells are, which are means of ten runs each: normal in their logarithms, with a model's error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...typing import Array
from ..verdicts import PRINTED_RUNS


@dataclass(frozen=True, slots=True)
class Prediction:
    """Logarithms of means of ten runs: normal, in rows that share no plant."""

    mean: Array
    """(rows, cells)."""
    covariance: Array
    """(rows, cells, cells): cells of a row share their plants."""

    def apart(self, groups: Sequence[int]) -> Prediction:
        """The same where only cells of one group, by the numbers of all cells, share their plants."""
        return Prediction(self.mean, self.covariance * np.equal.outer(groups, groups))

    def log_likelihood(self, printed: Array, error: float) -> float:
        """Of printed logarithms (rows, cells) with an independent relative error of the model in every cell."""
        parts = zip(printed - self.mean, self.with_error(error), strict=True)
        return sum(_log_normal(residual, covariance) for residual, covariance in parts)

    def with_error(self, error: float) -> Array:
        """The covariances with those of the model's error."""
        return self.covariance + error**2 * np.eye(self.mean.shape[1])


def ten_run_means(values: Array) -> Prediction:
    """What runs (rows, runs, cells) say of the logarithm of another mean of ten such runs, to second order.

    Its covariance holds that of the mean of these runs, too, which takes the place of the true one.
    """
    n = values.shape[1]
    mean = values.mean(axis=1, keepdims=True)
    off = values / mean - 1.0
    each = np.einsum("rni,rnj->rij", off, off) / (n - 1)
    covariance = each * (1.0 / PRINTED_RUNS + 1.0 / n)
    return Prediction(np.log(mean[:, 0]) - 0.5 * np.diagonal(each, axis1=1, axis2=2) / PRINTED_RUNS, covariance)


@dataclass(frozen=True, slots=True)
class Posterior:
    """Parameters after the printed cells, by a Laplace approximation under a flat prior."""

    shift: Array
    """Of the parameters, on their scale of logarithms, from where the model was made linear."""
    covariance: Array
    log_evidence: float
    """Of the cells, over all values of the parameters, up to a number that all models of these parameters share."""
    residuals: Array
    """log(printed / model) after the shift."""


def posterior(residuals: Array, slopes: Array, covariance: Array) -> Posterior:
    """Of parameters in which a model is linear.

    Args:
        residuals: log(printed / model), (cells,).
        slopes: derivative of the model's logarithms by the parameters, (cells, parameters).
        covariance: of the residuals.
    """
    weighted = np.linalg.solve(covariance, slopes)
    information = slopes.T @ weighted
    shift = np.linalg.solve(information, weighted.T @ residuals)
    left = residuals - slopes @ shift
    evidence = _log_normal(left, covariance) - 0.5 * float(np.linalg.slogdet(information)[1])
    return Posterior(np.asarray(shift), np.asarray(np.linalg.inv(information)), evidence, left)


def _log_normal(residual: Array, covariance: Array) -> float:
    _, volume = np.linalg.slogdet(covariance)
    squares = residual @ np.linalg.solve(covariance, residual)
    return -0.5 * float(squares + volume + len(residual) * math.log(2.0 * math.pi))
