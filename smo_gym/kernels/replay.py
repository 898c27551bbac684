"""An observer's block along recordings."""

import numpy as np

from ..typing import Array
from . import kernel
from .batch import LANES, VECTOR, load, store
from .blocks import XHAT, Y0, U, Y, call


@kernel
def replay(
    start: int,
    stop: int,
    rows: Array,
    where: int,
    own: int,
    end: int,
    period: int,
    h: Array,
    y: Array,
    u: Array,
    xhat: Array,
) -> None:
    """Call a block at each sample after the first and keep its estimates, for slots ``start`` to ``stop``.

    Args:
        start: first slot.
        stop: one behind the last.
        rows: (rows, n), signals first, as they are at the first sample.
        where: address of the block.
        own: first of its own rows.
        end: one behind the last of them.
        period: row of its own that is told the time since the sample before; below 0 for none.
        h: that time in s, (samples,); of the first it is not used.
        y: measured positions, (samples, 2, n).
        u: input from each sample to the next, (samples, 1, n).
        xhat: filled with the estimates from the second sample on, (samples, 4, n).
    """
    work = np.empty(rows.shape[0] * LANES)
    for first in range(start, stop, LANES):
        lanes = min(LANES, stop - first)
        width = lanes if lanes == 1 else (lanes + VECTOR - 1) // VECTOR * VECTOR
        load(work, 0, rows, first, lanes, width)
        mine = work[own * LANES : end * LANES]
        for k in range(1, len(h)):
            for c in range(2):
                for i in range(width):
                    work[(Y0 + c) * LANES + i] = work[(Y + c) * LANES + i]
            load(work, Y, y[k], first, lanes, width)
            load(work, U, u[k - 1], first, lanes, width)
            if period >= 0:
                for i in range(width):
                    mine[period * LANES + i] = h[k]
            call(where, work, mine, width)
            store(work, XHAT, xhat[k], first, lanes)
