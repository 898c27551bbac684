"""What a policy remembers from call to call, and forgets where an episode starts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..typing import Array, Flags
from ..validation import shape_of, short


def recalled(state: Any, *shapes: tuple[int, ...]) -> tuple[Array, ...] | None:
    """The arrays that the call before has left, or None.

    Raises:
        ValueError: they are of other shapes, as those of another policy or number of observations are.
    """
    if state is None:
        return None
    if not isinstance(state, tuple | list) or [shape_of(part) for part in state] != list(shapes):
        found = [shape_of(part) for part in state] if isinstance(state, tuple | list) else short(state)
        raise ValueError(
            f"state has shapes {found}, it must have {list(shapes)}: give what predict has returned for as many "
            "observations, or None at the start"
        )
    return tuple(np.asarray(part) for part in state)


def starts(episode_start: Any, n: int) -> Flags:
    """Where an episode starts, (n,).

    Raises:
        ValueError: it is neither one flag for all nor one a slot.
    """
    if shape_of(episode_start) not in ((), (n,)):
        raise ValueError(f"episode_start has shape {shape_of(episode_start)}, it must be one flag or have shape {(n,)}")
    return np.full(n, False if episode_start is None else episode_start, dtype=np.bool_)


def stacked(frame: Array, count: int, past: Array | None, episode_start: Any) -> Array:
    """The last frames, the newest last, (n, count, entries), from the newest (n, entries) and those before.

    Where an episode starts, and everywhere without a past, the first is repeated.

    Raises:
        ValueError: the past or the starts are not of as many slots.
    """
    repeated = np.repeat(frame[:, None], count, axis=1)
    first = starts(episode_start, len(frame))
    known = recalled(None if past is None else (past,), repeated.shape)
    if known is None:
        return repeated
    frames = np.concatenate([known[0][:, 1:], frame[:, None]], axis=1)
    return np.where(first[:, None, None], repeated, frames)
