"""What the reset of a batch asks for, checked and told slot by slot."""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..typing import Flags
from ..validation import short


def marked(mask: Any, n: int) -> Flags:
    """The slots to start, (n,), which the option ``reset_mask`` marks.

    Raises:
        ValueError: it is no boolean array of shape (n,), or marks none.
    """
    if not isinstance(mask, np.ndarray) or mask.shape != (n,) or mask.dtype != np.bool_:
        raise ValueError(f"options['reset_mask']={mask!r} must be a boolean array of shape ({n},)")
    if not mask.any():
        raise ValueError("options['reset_mask'] must mark at least one slot")
    return mask


def instants(steps: Any, n: int, most: int) -> NDArray[np.int64]:
    """The control instant that ends each slot's episode, (n,), from the option ``steps``.

    Raises:
        ValueError: a number is not whole or not from 1 to ``most``, or there are neither one nor n of them.
    """
    given = np.asarray(steps)
    whole = given.dtype.kind in "iu" and given.shape in ((), (n,))
    if not whole or given.min() < 1 or given.max() > most:
        raise ValueError(f"options['steps']={steps!r} must be a whole number from 1 to {most}, or {n} such numbers")
    return np.broadcast_to(given, n).astype(np.int64)


def seeds_of(seed: Any, n: int) -> list[int | None]:
    """Each slot's seed, None where it keeps its generator: s seeds slot i with s + i, a sequence says each slot's own.

    Raises:
        ValueError: it is neither None, nor a whole number, nor n of these.
    """
    if seed is None or isinstance(seed, numbers.Integral):
        return [None if seed is None else int(seed) + i for i in range(n)]
    each = list(seed) if isinstance(seed, Sequence | np.ndarray) else []
    if len(each) != n or not all(s is None or isinstance(s, numbers.Integral) for s in each):
        raise ValueError(f"seed={short(seed)} must be None, a whole number, or {n} of these, one a slot")
    return [None if s is None else int(s) for s in each]


def slot_by_slot(options: dict[str, Any], n: int) -> list[dict[str, Any]]:
    """Each slot's options, none where there are none: an array (n, 4) is taken apart, anything else is for all.

    So are n numbers of noise.
    """
    apart = {name: np.shape(value) == ((n,) if name == "noise" else (n, 4)) for name, value in options.items()}
    return [
        {name: value[i] if apart[name] else value for name, value in options.items()}
        for i in range(n if options else 0)
    ]
