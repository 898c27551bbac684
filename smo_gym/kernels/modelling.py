"""Blocks that are compiled once for each model: its right-hand side is inlined, its numbers are rows."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any

from ..typing import Array, State
from . import inlined, kernel, plain
from .batch import LANES
from .blocks import Block

Rhs = Callable[[State, float, Any], State]
"""``X' = rhs(X, s, (u, *params))``, where s in [0, 1] is how much of an integration step has passed."""
Params = Callable[[Array, int, int], tuple[float, ...]]
"""A model's numbers from their rows: ``params(own, first row, lane)``."""

_PACKAGE = __name__.partition(".")[0]


@cache
def _gathered(count: int) -> Params:
    if count == 0:

        def nothing(rows: Array, row: int, i: int) -> tuple[float, ...]:
            return ()

        return inlined(nothing)
    before, last = _gathered(count - 1), (count - 1) * LANES

    def numbers(rows: Array, row: int, i: int) -> tuple[float, ...]:
        return before(rows, row, i) + (rows[row * LANES + last + i],)  # noqa: RUF005  # Numba unpacks no tuple here

    return inlined(numbers)


def for_each_model(make: Callable[..., Block]) -> Callable[..., Block]:
    """``make(rhs, params, *options)`` as ``made(rhs, number of params, *options)``, compiled once for each.

    Cached on disk where all functions among these are this package's own: what others use may
    change without their file.
    """

    @cache
    @wraps(make)
    def made(rhs: Rhs, count: int, *options: Any) -> Block:
        functions = [plain(each) for each in (rhs, *options) if callable(each)]
        ours = all(each.__module__.partition(".")[0] == _PACKAGE for each in functions)
        return kernel(make(rhs, _gathered(count), *options), on_disk=ours)

    return made
