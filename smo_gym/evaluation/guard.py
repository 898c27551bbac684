"""What ends a run besides the task: an estimate that is lost or has left all bounds."""

import numpy as np

from ..kernels.blocks import FAILED, XHAT, Y, at, block, finite, four, offsets, put, put_four, two
from ..loop import Loop, Part, columns
from ..typing import Array

DIVERGED = 1e4
"""An observer of poor gains can diverge while its plant goes on. No estimate in m, rad, m/s, rad/s comes near this."""
START, AT_Y, _ = offsets(4, 1)


@block
def _guard(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        (h, theta), xhat, start = two(signals, Y, i), four(signals, XHAT, i), four(own, START, i)
        a, b, c, d = abs(xhat[0]), abs(xhat[1]), abs(xhat[2]), abs(xhat[3])
        # "and" would branch, and a loop with so many branches is not vectorised
        near = (abs(h) < DIVERGED) & (abs(theta) < DIVERGED)
        fine = near & (a < DIVERGED) & (b < DIVERGED) & (c < DIVERGED) & (d < DIVERGED)
        put(signals, FAILED, i, at(signals, FAILED, i) if fine else 1.0)
        at_y = at(own, AT_Y, i) > 0.0
        anew = h if at_y else start[0], theta if at_y else start[1], start[2], start[3]
        put_four(signals, XHAT, i, xhat if finite(xhat) else anew)


def guard(loop: Loop) -> Part:
    """Fail runs whose estimate or measurement comes to :data:`DIVERGED`; one that is not finite starts anew.

    ``loop`` is at a start, with an observer.
    """
    each = loop.parts["observer"]
    at_y = np.repeat([part.xhat is None for part in each], [part.rows.shape[1] for part in each])
    return Part(columns(loop.n, loop.xhat, at_y[None]), close=_guard)


def diverged(observation: Array) -> Array:
    """Which observations [h, theta, ..., xhat] (n, observation) the guard would fail, (n,)."""
    told = np.concatenate([observation[:, :2], observation[:, -4:]], axis=1)
    return np.asarray(~(np.abs(told) < DIVERGED).all(axis=1))
