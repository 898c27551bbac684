"""How far estimates of two velocities are from the truth, run by run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array

SETTLED = 2.0
"""Seconds after which errors count."""
NEAR = (0.05, 0.25)
"""An estimate has converged once its velocities stay within these of the truth, in m/s and rad/s: chosen."""
FIELDS = ("rmse", "largest", "lag", "total_variation", "convergence")
"""What is measured of each velocity, in the order of :class:`Errors`."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Of each velocity and run, (2, n)."""

    rmse: Array
    """RMS error after :data:`SETTLED`, in m/s and rad/s."""
    largest: Array
    """Largest error after that."""
    lag: Array
    """The delay in s that explains most of the error: to first order where the cross-correlation is largest."""
    total_variation: Array
    """Sum of |changes| of the estimate a second, after that."""
    convergence: Array
    """When in s the error comes within :data:`NEAR` for good; infinite where it never does."""


def errors(xhat: Array, x: Array, dt: float) -> Errors:
    """Errors of estimates ``xhat`` of states ``x``, each (samples, 4, n), evenly spaced by ``dt`` seconds."""
    v, truth = xhat[:, 2:], x[:, 2:]
    e = v - truth
    late = slice(round(SETTLED / dt), None)
    slope = np.gradient(truth, dt, axis=0)[late]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        lag = -(e[late] * slope).sum(0) / (slope**2).sum(0)
        outside = ~(np.abs(e) <= np.array(NEAR)[:, None])
        seconds = dt * (len(e) - np.argmax(outside[::-1], axis=0))
        converged = np.where(outside.any(0), np.where(outside[-1], np.inf, seconds), 0.0)
        return Errors(
            np.sqrt((e[late] ** 2).mean(0)),
            np.abs(e[late]).max(0),
            lag,
            np.abs(np.diff(v[late], axis=0)).sum(0) / (dt * (len(v[late]) - 1)),
            converged,
        )
