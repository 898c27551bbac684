"""Where a sum of -log of likelihoods is least, how well that determines each number, and whether it is there at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ..typing import Array

ENOUGH = 0.02
"""By how much the loss may still fall, as its slope and bend say, where a search has converged: 0.2 standard errors."""
ITERATIONS = 60
_FLAT = 1e-6  # of what the loss bends along one number alone
_STEP = 0.3  # standard errors, of the differences that a Hessian is made of
_FIRST, _BEND = 1e-3, (1e-3, 1e3)

Loss = Callable[[Array], float]


@dataclass(frozen=True, slots=True)
class Optimum:
    """Where a search ended."""

    x: Array
    errors: Array
    """Standard errors, from the Hessian; of no meaning where it is flat."""
    left: float
    """By how much the loss may still fall."""
    flat: bool
    """Whether the loss does not tell some numbers apart."""
    loosest: int
    """Which number is told least."""

    @property
    def converged(self) -> bool:
        """Whether nothing is left to win and all numbers are told."""
        return not self.flat and self.left < ENOUGH


def search(loss: Loss, x: Array, rounds: int) -> Optimum:
    """Minimise a loss, the sum of -log of likelihoods, from where x is.

    L-BFGS-B, in coordinates in which the loss bends the same in all directions; they are made anew from the Hessian
    where it ends, until it has converged or there were so many rounds.
    """
    alone = np.array([_alone(loss, x, i) for i in range(len(x))])
    axes = np.diag(alone)
    for _ in range(rounds):
        x = _descended(loss, x, axes)
        slope, bend = _bent(loss, x, axes)
        powers, turned = np.linalg.eigh(bend)
        flat, powers = bool(powers[0] < _FLAT), np.maximum(np.abs(powers), _FLAT)
        axes = axes @ turned / np.sqrt(powers)  # times its transpose it is the inverse of the Hessian
        left = 0.5 * float(((turned.T @ slope) ** 2 / powers).sum())
        loosest = int(np.abs(axes[:, 0] / alone).argmax())
        found = Optimum(x, np.sqrt((axes**2).sum(1)), left, flat, loosest)
        if found.converged:
            break
    return found


def _alone(loss: Loss, x: Array, i: int) -> float:
    """The step of one number that raises the loss by a half: its standard error if all others were known."""
    step, here = _FIRST * max(abs(x[i]), 10.0 * _FIRST), loss(x)
    for _ in range(4):
        d = step * (np.arange(len(x)) == i)
        step /= np.sqrt(np.clip(abs(loss(x + d) + loss(x - d) - 2.0 * here), *_BEND))
    return float(step)


def _descended(loss: Loss, x: Array, axes: Array) -> Array:
    here = loss(x)
    options = {"maxiter": ITERATIONS, "maxfun": 10**6, "eps": 1e-2, "ftol": 1e-12, "gtol": 1e-2}
    found = minimize(lambda z: loss(x + axes @ z) - here, np.zeros(len(x)), method="L-BFGS-B", options=options)
    return np.asarray(x + axes @ found.x)


def _bent(loss: Loss, x: Array, axes: Array) -> tuple[Array, Array]:
    """Gradient and Hessian along axes, by central differences."""
    n, here, d = len(x), loss(x), _STEP * axes
    more, less = (np.array([loss(x + s * d[:, i]) for i in range(n)]) for s in (1.0, -1.0))
    bend = np.diag(more + less - 2.0 * here)
    for i in range(n):
        for j in range(i):
            both = loss(x + d[:, i] + d[:, j]) + loss(x - d[:, i] - d[:, j])
            bend[i, j] = bend[j, i] = 0.5 * (both - more[i] - less[i] - more[j] - less[j] + 2.0 * here)
    return (more - less) / (2.0 * _STEP), bend / _STEP**2
