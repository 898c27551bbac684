"""What becomes of the force that a law wants."""

import math

from .kernels.blocks import ALIVE, FAILED, U, at, block, offsets, put
from .loop import Part, columns
from .typing import Array

LIMIT, REFUSED, _ = offsets(1, 1)


@block
def _limited(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        wanted, limit, alive = at(signals, U, i), at(own, LIMIT, i), at(signals, ALIVE, i) > 0.0
        fine = math.isfinite(wanted)
        force = min(max(wanted, -limit), limit)
        put(signals, U, i, force if fine and alive else 0.0)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put(own, REFUSED, i, wanted if alive and not fine else at(own, REFUSED, i))


def limited(n: int, limit: float) -> Part:
    """A force within ``limit`` newtons, and none in slots that hold still.

    One that is not finite fails the slot and is kept in the row REFUSED, which is 0 else.
    """
    return Part(columns(n, limit, 0.0), act=_limited)
