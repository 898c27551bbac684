"""A batch of slots: blocks of lanes in a flat workspace, and threads over blocks.

The public arrays are (rows, n), one row a quantity. A kernel copies ``LANES`` slots of each row into a workspace where
row r starts at ``r * LANES``. All its accesses are then constant offsets into one array, so the compiler proves without
run-time checks that lanes are independent and vectorises the loop over them.
"""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ..typing import Array
from ..validation import whole
from . import inlined

LANES = 64
VECTOR = 8
"""Lanes that one vector instruction takes at most."""
# Below this many microseconds of work for one core, waking a second thread costs more than it saves.
_WORTH_A_THREAD = 500.0


@inlined
def load(work: Array, row: int, rows: Array, first: int, lanes: int, width: int) -> None:
    """Copy ``lanes`` slots from slot ``first`` on of a (rows, n) array into the workspace's rows from ``row`` on.

    Lanes from there up to ``width`` repeat the first slot.
    """
    for r in range(rows.shape[0]):
        target, source = work[(row + r) * LANES :], rows[r, first:]
        for i in range(lanes):
            target[i] = source[i]
        for i in range(lanes, width):
            target[i] = source[0]


@inlined
def store(work: Array, row: int, rows: Array, first: int, lanes: int) -> None:
    """Copy the workspace's rows back into a (rows, n) array, the reverse of :func:`load`."""
    for r in range(rows.shape[0]):
        source, target = work[(row + r) * LANES :], rows[r, first:]
        for i in range(lanes):
            target[i] = source[i]


class _Pool:
    """Worker threads, made at first need; a forked child starts without any."""

    def __init__(self) -> None:
        self.threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.executor: ThreadPoolExecutor | None = None

    def drop(self) -> None:
        self.executor = None

    def get(self) -> ThreadPoolExecutor:
        if self.executor is None:
            self.executor = ThreadPoolExecutor(self.threads, thread_name_prefix="smo_gym")
        return self.executor


_pool = _Pool()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.drop)


def set_threads(threads: int) -> None:
    """Use at most this many threads for large batches (default: all cores that the process may use).

    Results do not depend on it.

    Raises:
        ValueError: ``threads`` is no positive integer.
    """
    _pool.threads = whole("threads", threads, 1)
    _pool.drop()


def for_slots(kernel: Callable[..., None], start: int, stop: int, microseconds_a_slot: float, *args: Any) -> None:
    """Run ``kernel(start, stop, *args)`` over slots, in threads where the work is worth it."""
    n = stop - start
    if n <= LANES or n * microseconds_a_slot < _WORTH_A_THREAD or _pool.threads == 1:
        kernel(start, stop, *args)
        return
    vectors = -(-n // VECTOR)
    threads = min(_pool.threads, -(-n // LANES))
    bounds = [min(stop, start + VECTOR * (vectors * k // threads)) for k in range(threads + 1)]
    others = [_pool.get().submit(kernel, a, b, *args) for a, b in itertools.pairwise(bounds[1:])]
    kernel(bounds[0], bounds[1], *args)
    for other in others:
        other.result()
