"""What ends a run besides the task: an estimate that is lost or has left all bounds."""

import numpy as np

from ..kernels.blocks import FAILED, XHAT, Y, at, block, finite, four, offsets, put, put_four, two
from ..loop import Part
from ..typing import Array

DIVERGED = 1e4
"""An observer of poor gains can diverge while its plant goes on. No estimate in m, rad, m/s, rad/s comes near this."""
START, _ = offsets(4)


@block
def _guard(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        (h, theta), xhat, start = two(signals, Y, i), four(signals, XHAT, i), four(own, START, i)
        a, b, c, d = abs(xhat[0]), abs(xhat[1]), abs(xhat[2]), abs(xhat[3])
        # "and" would branch, and a loop with so many branches is not vectorised
        near = (abs(h) < DIVERGED) & (abs(theta) < DIVERGED)
        fine = near & (a < DIVERGED) & (b < DIVERGED) & (c < DIVERGED) & (d < DIVERGED)
        put(signals, FAILED, i, at(signals, FAILED, i) if fine else 1.0)
        put_four(signals, XHAT, i, xhat if finite(xhat) else start)


def guard(xhat: Array) -> Part:
    """Fail runs whose estimate or measurement comes to :data:`DIVERGED`; what is not finite starts at ``xhat`` anew."""
    return Part(xhat.copy(), close=_guard)


def diverged(observation: Array) -> Array:
    """Which observations [h, theta, ..., xhat] (n, observation) the guard would fail, (n,)."""
    told = np.concatenate([observation[:, :2], observation[:, -4:]], axis=1)
    return np.asarray(~(np.abs(told) < DIVERGED).all(axis=1))
