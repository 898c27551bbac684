"""An observer's block along a recording."""

from ..typing import Array
from . import kernel
from .batch import LANES
from .blocks import XHAT, Y0, U, Y, call


@kernel
def replay(
    rows: Array, where: int, first: int, last: int, period: int, h: Array, y: Array, u: Array, xhat: Array
) -> None:
    """Call a block at each sample after the first and keep its estimates.

    Args:
        rows: (rows, 1), signals first, as they are at the first sample.
        where: address of the block.
        first: of its own rows.
        last: one behind its own rows.
        period: row that is told the time since the sample before; below 0 for none.
        h: time since the sample before in s, (samples,); that of the first is not used.
        y: measured positions, (samples, 2).
        u: input from each sample to the next, (samples,).
        xhat: filled with the estimates from the second sample on, (samples, 4).
    """
    work = rows.repeat(LANES)
    own = work[first * LANES : last * LANES]
    for k in range(1, len(y)):
        for c in range(2):
            work[(Y0 + c) * LANES] = work[(Y + c) * LANES]
            work[(Y + c) * LANES] = y[k, c]
        work[U * LANES] = u[k - 1]
        if period >= 0:
            own[period * LANES] = h[k]
        call(where, work, own, 1)
        for c in range(4):
            xhat[k, c] = work[(XHAT + c) * LANES]
