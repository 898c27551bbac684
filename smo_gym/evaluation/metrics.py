"""Metrics of closed-loop runs, summed up step by step: memory does not grow with the length of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..kernels import kernel
from ..plant import STATE_NAMES
from ..typing import Array, Flags

NAMES = (
    "mse_h",  # mean of (h - h_d)^2 over the sampling instants, m^2; h_d = 0 without a reference
    "mse_theta",  # the same of theta, rad^2
    *(f"estimation_rms_{name}" for name in STATE_NAMES),  # of xhat - x over the control instants; NaN without observer
    "effort",  # integral of u^2, N^2 s
    "total_variation",  # sum of |u_k - u_{k-1}|, from u = 0, N
    "peak_h",  # largest |h - h_d| at a sampling instant, m
    "peak_theta",  # the same of theta, rad
    "peak_force",  # largest |u|, N
    "peak_h_dot",  # largest |h'| at a control instant, m/s
    "peak_theta_dot",  # the same of theta', rad/s
    *(f"peak_estimate_{name}" for name in STATE_NAMES[1:]),  # largest |xhat| of these; NaN without observer
    "duration",  # until the horizon or the failure, s
)
_PREVIOUS_FORCE, _SAMPLES, _PERIODS = 16, 17, 18


def start(n: int) -> Array:
    """Sums of n runs at their beginning."""
    return np.zeros((19, n))


def add(sums: Array, info: dict[str, Any], xhat: Array, over: Flags) -> None:
    """Add one control period, which ended with the estimates ``xhat`` (n, 4), to all runs that are not over yet."""
    deviation = info["samples"] - info["desired"] if "desired" in info else info["samples"]
    _add(sums, deviation, info["state"], xhat, info["force"], over)


def finish(sums: Array, control_period: float) -> dict[str, Array]:
    """Name to values (n,) in the units of :data:`NAMES`."""
    periods = sums[_PERIODS]
    values = [
        *(sums[:2] / sums[_SAMPLES]),
        *np.sqrt(sums[2:6] / periods),
        sums[6] * control_period,
        *sums[7:16],
        periods * control_period,
    ]
    return dict(zip(NAMES, values, strict=True))


@kernel
def _add(sums: Array, deviation: Array, x: Array, xhat: Array, u: Array, over: Flags) -> None:
    for i in range(len(u)):
        if over[i]:
            continue
        for k in range(deviation.shape[1]):
            h, theta = deviation[i, k, 0], deviation[i, k, 1]
            sums[0, i] += h * h
            sums[1, i] += theta * theta
            sums[8, i] = max(sums[8, i], abs(h))
            sums[9, i] = max(sums[9, i], abs(theta))
        for j in range(4):
            error = xhat[i, j] - x[i, j]
            sums[2 + j, i] += error * error
        sums[6, i] += u[i] * u[i]
        sums[7, i] += abs(u[i] - sums[_PREVIOUS_FORCE, i])
        sums[10, i] = max(sums[10, i], abs(u[i]))
        sums[11, i] = max(sums[11, i], abs(x[i, 2]))
        sums[12, i] = max(sums[12, i], abs(x[i, 3]))
        for j in range(1, 4):
            estimate = abs(xhat[i, j])
            if not estimate <= sums[12 + j, i]:  # NaN too is kept
                sums[12 + j, i] = estimate
        sums[_PREVIOUS_FORCE, i] = u[i]
        sums[_SAMPLES, i] += deviation.shape[1]
        sums[_PERIODS, i] += 1.0
