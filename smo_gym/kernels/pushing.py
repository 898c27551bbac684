"""Disturbances as blocks: the waves of each, their sum in the rows PUSH, and a function of a user's own."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np

from ..typing import Array
from . import COMPILES, inlined
from .batch import LANES
from .blocks import ALIVE, FAILED, PUSH, Block, X, at, block, four, offsets, put, put_two, two
from .elementary import rounded, sincos
from .noise import STREAMS, two_normals, uniform

KINDS = ("constant", "step", "sine", "pulses", "noise", "function")
_SINE, _PULSES, _NOISE, _FUNCTION = 2.0, 3.0, 4.0, 5.0

KEY, COUNT, DT, HOW_MANY, REFUSED, WAVE, FIRST = offsets(1, 1, 1, 1, 1, 2)
"""Rows of the part: the episode's key, samples since it began, the sampling period, how many disturbances there are,
the time in s at which their sum was not finite, else 0, and the wave of the one whose turn it is."""
KIND, WIDTH, KEPT, FRESH, FREQUENCY, PHASE, START, SIZE, STATE, GROUP = offsets(1, 1, 1, 1, 1, 1, 1, 2, 2)
"""Behind them, rows of each disturbance: noise keeps KEPT of its STATE and adds FRESH."""
_STREAM = 32
"""Streams of the d-th disturbance's noise begin here, two for each."""
_TWO_PI = 6.283185307179586

Function = Callable[[float, float, float, float, float], tuple[float, float]]


@inlined
def _since(own: Array, d: int, i: int) -> float:
    """Time at the middle of the sampling period since the disturbance whose rows begin at ``d`` began."""
    dt = own[DT * LANES]
    return (at(own, COUNT, i) + 0.5) * dt - at(own, d + START, i)  # type: ignore[no-any-return]


@inlined
def _level(own: Array, lanes: int) -> None:
    for i in range(lanes):
        put_two(own, WAVE, i, (1.0, 1.0))


@inlined
def _swing(own: Array, d: int, lanes: int) -> None:
    for i in range(lanes):
        turns = _since(own, d, i) * at(own, d + FREQUENCY, i)
        sine, _ = sincos(_TWO_PI * (turns - rounded(turns)) + at(own, d + PHASE, i))
        put_two(own, WAVE, i, (sine, sine))


@inlined
def _pulse(own: Array, d: int, lanes: int) -> None:
    width = own[(d + WIDTH) * LANES]
    for i in range(lanes):
        frequency = at(own, d + FREQUENCY, i)
        turns = _since(own, d, i) * frequency
        wave = 1.0 if turns - np.floor(turns) < width * frequency else 0.0
        put_two(own, WAVE, i, (wave, wave))


@inlined
def _draw(own: Array, lanes: int, stream: int) -> None:
    for i in range(lanes):
        key, index = at(own, KEY, i), STREAMS * at(own, COUNT, i) + stream
        put_two(own, WAVE, i, two_normals(uniform(key, index), uniform(key, index + 1.0)))


@inlined
def _wander(own: Array, d: int, lanes: int) -> None:
    kept, fresh = own[(d + KEPT) * LANES], own[(d + FRESH) * LANES]
    for i in range(lanes):
        # as stationary at the start as ever: the state there is 0
        (a, b), state, new = two(own, WAVE, i), two(own, d + STATE, i), fresh if at(own, COUNT, i) > 0.0 else 1.0
        wave = kept * state[0] + new * a, kept * state[1] + new * b
        put_two(own, d + STATE, i, wave)
        put_two(own, WAVE, i, wave)


@inlined
def _add(signals: Array, own: Array, d: int, lanes: int) -> None:
    for i in range(lanes):
        since, push, size, wave = _since(own, d, i), two(signals, PUSH, i), two(own, d + SIZE, i), two(own, WAVE, i)
        more = push[0] + size[0] * wave[0], push[1] + size[1] * wave[1]
        put_two(signals, PUSH, i, (more[0] if since >= 0.0 else push[0], more[1] if since >= 0.0 else push[1]))


@inlined
def _clear(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put_two(signals, PUSH, i, (0.0, 0.0))


@inlined
def _sum_up(signals: Array, own: Array, lanes: int) -> None:
    _clear(signals, own, lanes)
    for k in range(int(own[HOW_MANY * LANES])):
        d = FIRST + k * GROUP
        kind = own[(d + KIND) * LANES]
        if kind == _SINE:
            _swing(own, d, lanes)
        elif kind == _PULSES:
            _pulse(own, d, lanes)
        elif kind == _NOISE:
            _draw(own, lanes, _STREAM + 2 * k)
            _wander(own, d, lanes)
        elif kind != _FUNCTION:
            _level(own, lanes)
        if kind != _FUNCTION:
            _add(signals, own, d, lanes)


@inlined
def _settle(signals: Array, own: Array, lanes: int) -> None:
    dt = own[DT * LANES]
    for i in range(lanes):
        (force, torque), count, going = two(signals, PUSH, i), at(own, COUNT, i) + 1.0, at(signals, ALIVE, i) > 0.0
        refused, failed = at(own, REFUSED, i), at(signals, FAILED, i)
        fine = (force - force) + (torque - torque) == 0.0
        lost, pushed = going & (not fine), going & fine
        put_two(signals, PUSH, i, (force if pushed else 0.0, torque if pushed else 0.0))
        put(signals, FAILED, i, 1.0 if lost else failed)
        put(own, REFUSED, i, count * dt if lost & (refused == 0.0) else refused)
        put(own, COUNT, i, count)


@block
def push(signals: Array, own: Array, lanes: int) -> None:
    """The sum of disturbances over one sampling period; none in runs that have ended."""
    _sum_up(signals, own, lanes)
    _settle(signals, own, lanes)


@cache
def compiled(function: Function) -> Any:
    """A function for a block; one that is compiled already is left as it is."""
    if not COMPILES or hasattr(function, "py_func"):
        return function
    return numba.njit(error_model="numpy")(function)


@cache
def push_with(function: Function) -> Block:
    """:func:`push` and a function of t, at the middle of the sampling period, and of the state when that begins."""
    of_user = compiled(function)

    def push_and_more(signals: Array, own: Array, lanes: int) -> None:
        _sum_up(signals, own, lanes)
        dt = own[DT * LANES]
        for i in range(lanes):
            h, theta, v, omega = four(signals, X, i)
            force, torque = of_user((at(own, COUNT, i) + 0.5) * dt, h, theta, v, omega)
            before = two(signals, PUSH, i)
            put_two(signals, PUSH, i, (before[0] + force, before[1] + torque))
        _settle(signals, own, lanes)

    # not cached on disk: what the function uses may change without its file
    return numba.njit(error_model="numpy", nogil=True)(push_and_more) if COMPILES else push_and_more
