"""What pushes the cart and turns the rod besides the actuator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numba
import numpy as np

from .kernels import COMPILES
from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, PUSH, Block, X, at, block, four, offsets, put, put_two, two
from .kernels.elementary import sincos
from .kernels.noise import STREAMS, two_normals, uniform, uniforms
from .loop import Part, Slots, columns
from .typing import Array
from .validation import choice, mapping, number, short

KINDS = ("constant", "step", "sine", "pulses", "noise", "function")
DRAWN = ("force", "torque", "start", "frequency", "phase")
Function = Callable[[float, float, float, float, float], tuple[float, float]]
_STREAM, _DRAWS = 32, 48
"""Streams of an episode's random numbers: two for each sample, and the draws, of disturbance k at sample k."""
_TWO_PI = 2.0 * math.pi

KEY, COUNT, DT, HOW_MANY, REFUSED, FIRST = offsets(1, 1, 1, 1, 1)
SIZE, START, FREQUENCY, PHASE, WIDTH, KEPT, KIND, STATE, _GROUP = offsets(2, 1, 1, 1, 1, 1, 1, 2)
"""Rows of the part, and behind them rows of each disturbance."""
_SHAPES, _NOISE = ("constant", "step", "sine", "pulses"), float(KINDS.index("noise"))
_SINE, _PULSES = float(KINDS.index("sine")), float(KINDS.index("pulses"))


@block
def _push(signals: Array, own: Array, lanes: int) -> None:
    dt, many = own[DT * LANES], int(own[HOW_MANY * LANES])
    for i in range(lanes):
        put_two(signals, PUSH, i, (0.0, 0.0))
    for d in range(many):
        group = own[(FIRST + d * _GROUP) * LANES :]
        kind = group[KIND * LANES]
        if kind == _NOISE:
            for i in range(lanes):
                key, index = at(own, KEY, i), STREAMS * at(own, COUNT, i) + (_STREAM + 2 * d)
                fresh = two_normals(uniform(key, index), uniform(key, index + 1.0))
                kept, state = at(group, KEPT, i), two(group, STATE, i)
                kept = 0.0 if at(own, COUNT, i) == 0.0 else kept  # as stationary at the start as ever
                new = math.sqrt(1.0 - kept * kept)
                put_two(group, STATE, i, (kept * state[0] + new * fresh[0], kept * state[1] + new * fresh[1]))
        else:
            for i in range(lanes):
                since = (at(own, COUNT, i) + 0.5) * dt - at(group, START, i)
                turns = since * at(group, FREQUENCY, i)
                sine, _ = sincos(_TWO_PI * turns + at(group, PHASE, i))
                pulse = 1.0 if (turns - math.floor(turns)) < at(group, WIDTH, i) * at(group, FREQUENCY, i) else 0.0
                wave = sine if kind == _SINE else (pulse if kind == _PULSES else 1.0)
                wave = wave if since >= 0.0 else 0.0
                put_two(group, STATE, i, (wave, wave))
        for i in range(lanes):
            push, size, state = two(signals, PUSH, i), two(group, SIZE, i), two(group, STATE, i)
            put_two(signals, PUSH, i, (push[0] + size[0] * state[0], push[1] + size[1] * state[1]))
    for i in range(lanes):
        put(own, COUNT, i, at(own, COUNT, i) + 1.0)


@cache
def _with(function: Function) -> Block:
    """A block of :func:`_push` and a function."""
    compiled = function
    if COMPILES and not hasattr(function, "py_func"):
        compiled = numba.njit(error_model="numpy")(function)

    def push(signals: Array, own: Array, lanes: int) -> None:
        _push(signals, own, lanes)
        dt = own[DT * LANES]
        for i in range(lanes):
            h, theta, h_dot, theta_dot = four(signals, X, i)
            t = (at(own, COUNT, i) - 0.5) * dt
            force, torque = compiled(t, h, theta, h_dot, theta_dot)
            before = two(signals, PUSH, i)
            fine, alive = math.isfinite(force + torque), at(signals, ALIVE, i) > 0.0
            put_two(signals, PUSH, i, (before[0] + (force if fine else 0.0), before[1] + (torque if fine else 0.0)))
            put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
            put(own, REFUSED, i, t if alive and not fine and at(own, REFUSED, i) == 0.0 else at(own, REFUSED, i))

    return numba.njit(error_model="numpy", nogil=True)(push) if COMPILES else push  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Disturbance:
    """A force on the cart beside the actuator's, a matched disturbance, and a torque about the pivot.

    ``size w(t)`` from ``start`` on, 0 before, held over each integration step at its middle, with w = 1 for "constant"
    and "step"; sin(2 pi frequency (t - start) + phase) for "sine"; for "pulses" 1 during the first ``width`` seconds of
    each period, else 0. For "noise" the size is the standard deviation of w, which is Gauss-Markov noise, white noise
    through a first-order low-pass with the cut-off ``bandwidth``: its autocorrelation is exp(-2 pi bandwidth |tau|), from
    the first instant on, force and torque independent. "function" is one of one's own.

    ``force``, ``torque``, ``start``, ``frequency`` and ``phase`` may be a pair (low, high), from which each episode draws
    its own, uniformly.

    Args:
        kind: one of :data:`KINDS`.
        force: size in N.
        torque: size in N m.
        start: in s.
        frequency: in Hz, of "sine" and "pulses".
        phase: in rad, of "sine".
        width: of a pulse in s.
        bandwidth: in Hz, of "noise".
        function: f(t, h, theta, h', theta') -> (force, torque), which Numba can compile.

    Raises:
        ValueError: an unknown kind, or a value that is not allowed.
    """

    kind: str = "constant"
    force: float | tuple[float, float] = 0.0
    torque: float | tuple[float, float] = 0.0
    start: float | tuple[float, float] = 0.0
    frequency: float | tuple[float, float] = 1.0
    phase: float | tuple[float, float] = 0.0
    width: float = 0.1
    bandwidth: float = 1.0
    function: Function | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        choice("kind of disturbance", self.kind, KINDS)
        for name in DRAWN:
            set_(self, name, _drawn(f"disturbance {name}", getattr(self, name)))
        for name in ("width", "bandwidth"):
            set_(self, name, number(f"disturbance {name}", getattr(self, name), above=0.0))
        if min(self._ends("start")) < 0.0:
            raise ValueError(f"disturbance start={self.start!r} must be at least 0")
        if min(self._ends("frequency")) <= 0.0:
            raise ValueError(f"disturbance frequency={self.frequency!r} must be greater than 0")
        if self.kind == "pulses" and self.width * max(self._ends("frequency")) > 1.0:
            raise ValueError(
                f"disturbance width={self.width!r} must be at most a period of frequency={self.frequency!r}"
            )
        if (self.kind == "function") != callable(self.function):
            raise ValueError(
                f"disturbance function={short(self.function)} must be given for the kind 'function', and for no other"
            )
        if self.function is not None:
            _tried(self.function)

    def _ends(self, name: str) -> tuple[float, float]:
        value = getattr(self, name)
        return value if isinstance(value, tuple) else (value, value)

    @classmethod
    def of(cls, value: Any) -> tuple[Disturbance, ...]:
        """Disturbances that add up: from None for none, one, a mapping of its fields, a function, or several of these.

        Raises:
            ValueError: it is none of these, a field is unknown, a value is not allowed, or two are functions.
        """
        if value is None:
            return ()
        if isinstance(value, cls):
            return (value,)
        if isinstance(value, Mapping):
            return (cls(**mapping("disturbance setting", value, [field.name for field in fields(cls)])),)
        if callable(value):
            return (cls("function", function=value),)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ValueError(
                f"disturbance={short(value)} must be a Disturbance, a mapping of its fields, a function or several of these"
            )
        found = tuple(one for each in value for one in cls.of(each))
        if sum(one.function is not None for one in found) > 1:
            raise ValueError(f"disturbance={short(value)} has several functions: let one of them add them up")
        if len(found) > _MOST:
            raise ValueError(f"disturbance has {len(found)} parts, it must have at most {_MOST}")
        return found

    @property
    def random(self) -> bool:
        """Whether it differs from episode to episode."""
        return self.kind == "noise" or any(isinstance(getattr(self, name), tuple) for name in DRAWN)

    def check(self, dt: float, horizon: float) -> None:
        """See that it acts within an episode of ``horizon`` seconds.

        Raises:
            ValueError: it begins after its end.
        """
        if max(self._ends("start")) >= horizon:
            raise ValueError(f"disturbance start={self.start!r} must be before the episode's end at {horizon:g} s")


_MOST = 8
"""Most disturbances at once: each has streams of its own."""


def _drawn(name: str, value: Any) -> float | tuple[float, float]:
    if not isinstance(value, list | tuple):
        return number(name, value)
    if len(value) != 2:
        raise ValueError(f"{name}={short(value)} must be a number or a pair (low, high)")
    low, high = (number(name, end) for end in value)
    if low > high:
        raise ValueError(f"{name}={short(value)} has low above high")
    return low, high


def _tried(function: Function) -> None:
    """See that a function takes and gives what it must."""
    try:
        force, torque = getattr(function, "py_func", function)(0.0, 0.0, 0.0, 0.0, 0.0)
        float(force), float(torque)
    except Exception as error:  # whatever a user's function may raise
        raise ValueError(
            f"disturbance function={short(function)} must take (t, h, theta, h_dot, theta_dot) and give (force, torque): "
            f"{type(error).__name__}: {error}"
        ) from error


def part(disturbances: Sequence[Disturbance], n: int, dt: float) -> Part:
    """What disturbances put into a loop of n slots with a sampling period of ``dt`` seconds, before the plant.

    Their sum is in the rows PUSH. Where it is not finite, the slot fails, and the row REFUSED is the time in s.
    """
    groups = [
        columns(1, [0.0] * KEPT, math.exp(-_TWO_PI * each.bandwidth * dt), float(KINDS.index(each.kind)), [0.0] * 2)
        for each in disturbances
    ]
    for each, group in zip(disturbances, groups, strict=True):
        group[WIDTH] = each.width
    rows = columns(n, np.zeros(2), dt, float(len(groups)), 0.0, *(np.repeat(group, n, axis=1) for group in groups))
    begin(rows, slice(None), disturbances, np.zeros(n))
    functions = [each.function for each in disturbances if each.function is not None]
    return Part(rows, sample=_with(functions[0]) if functions else _push, alike=(float(len(groups)),))


def begin(own: Array, slots: Slots, disturbances: Sequence[Disturbance], keys: Array) -> None:
    """Draw, in some slots, what episodes of these keys have."""
    own[KEY, slots] = keys
    for k, each in enumerate(disturbances):
        drawn = uniforms(keys, [STREAMS * k + _DRAWS + j for j in range(len(DRAWN))])
        for row, name, u in zip((SIZE, SIZE + 1, START, FREQUENCY, PHASE), DRAWN, drawn, strict=True):
            low, high = each._ends(name)
            own[FIRST + k * _GROUP + row, slots] = low + (high - low) * u
