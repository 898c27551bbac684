"""What pushes the cart and turns the rod besides the actuator."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import FunctionType
from typing import Any

import numpy as np
from numba import types
from numba.core.errors import NumbaError

from .kernels import COMPILES, plain, pushing
from .kernels.noise import STREAMS, uniforms
from .kernels.pushing import KINDS, Function
from .loop import Loop, Part, Slots, columns
from .typing import Array
from .validation import choice, mapping, number, shape_of, short

Drawn = float | tuple[float, float]

DRAWN = ("force", "torque", "start", "frequency", "phase")
"""What may be a pair (low, high)."""
_OF_KIND = {
    "constant": ("force", "torque"),
    "step": ("force", "torque", "start"),
    "sine": ("force", "torque", "start", "frequency", "phase"),
    "pulses": ("force", "torque", "start", "frequency", "width"),
    "noise": ("force", "torque", "start", "bandwidth"),
    "function": ("function",),
}
_DRAWS = 48
"""Streams that sizes are drawn from begin here: those of the d-th disturbance at sample d."""
_MOST = 8
"""Disturbances at once: each has two streams of noise of its own."""
_REAL = (types.Float, types.Integer)
_TAKES = "must take (t, h, theta, h_dot, theta_dot) and give (force, torque)"


@dataclass(frozen=True, slots=True)
class Disturbance:
    """A force on the cart beside the actuator's, which is matched, and a torque about the pivot, which is not.

    From ``start`` on they are ``force w(t)`` and ``torque w(t)``, before 0, with

    ::

        constant, step   w = 1                                          a constant one begins at 0
        sine             w = sin(2 pi frequency (t - start) + phase)
        pulses           w = 1 for the first width seconds of each 1 / frequency since start, else 0
        noise            w of mean 0, variance 1, autocorrelation exp(-2 pi bandwidth |tau|)

    and held over a sampling period as they are at its middle. Noise is a Gauss-Markov process, white noise through a
    first-order low-pass with the cut-off ``bandwidth``, exact at the samples and stationary from the first; that of
    force and of torque are independent. A "function" is one's own, f(t, h, theta, h_dot, theta_dot) -> (force, torque)
    in N and N m, of the time at the middle and the state at the beginning of a period.

    Args:
        kind: one of :data:`~smo_gym.kernels.pushing.KINDS`.
        force: size in N, of noise its standard deviation. Like the next four a number, or a pair (low, high) from which
            each episode draws its own, uniformly.
        torque: size in N m, as ``force``.
        start: in s.
        frequency: in Hz; of a sine at most half the sampling rate.
        phase: in rad, at most a turn either way.
        width: of a pulse in s, at most a period.
        bandwidth: in Hz.
        function: which Numba can compile. Globals that it reads are those of its first use, for good: settings that
            differ between functions belong into a closure.

    Raises:
        ValueError: an unknown kind, a value that is not allowed, or one that the kind has no use for.
    """

    kind: str = "constant"
    force: Drawn = 0.0
    torque: Drawn = 0.0
    start: Drawn = 0.0
    frequency: Drawn = 1.0
    phase: Drawn = 0.0
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
        if self.ends("start")[0] < 0.0:
            raise ValueError(f"disturbance start={self.start!r} must be at least 0")
        if self.ends("frequency")[0] <= 0.0:
            raise ValueError(f"disturbance frequency={self.frequency!r} must be greater than 0")
        if max(map(abs, self.ends("phase"))) > 2.0 * math.pi:
            raise ValueError(f"disturbance phase={self.phase!r} must be within a turn, from -2 pi to 2 pi")
        self._check_use()
        if self.kind == "pulses" and self.width * self.ends("frequency")[1] > 1.0:
            raise ValueError(
                f"disturbance width={self.width!r} must be at most 1 / frequency for frequency={self.frequency!r}"
            )
        if self.kind == "function":
            _tried(self.function)

    def _check_use(self) -> None:
        """See that nothing is set which the kind would be silent about."""
        for f in fields(self)[1:]:
            value = getattr(self, f.name)
            if value != f.default and f.name not in _OF_KIND[self.kind]:
                users = [kind for kind, names in _OF_KIND.items() if f.name in names]
                raise ValueError(
                    f"disturbance {f.name}={short(value)} is of no use to kind={self.kind!r}: leave it out, or take "
                    f"kind {' or '.join(map(repr, users))}"
                )

    def ends(self, name: str) -> tuple[float, float]:
        """The pair (low, high) of a setting, both alike where it is a number."""
        value = getattr(self, name)
        return value if isinstance(value, tuple) else (value, value)

    @classmethod
    def of(cls, value: Any) -> tuple[Disturbance, ...]:
        """Disturbances that add up: from None for none, one, a mapping of its fields, a function, or several of these.

        Raises:
            ValueError: it is none of these, or a value is not allowed.
        """
        if value is None:
            return ()
        if isinstance(value, cls):
            return (value,)
        if isinstance(value, Mapping):
            return (cls(**mapping("disturbance setting", value, [f.name for f in fields(cls)])),)
        if callable(value):
            return (cls("function", function=value),)
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ValueError(
                f"disturbance={short(value)} must be a Disturbance, a mapping of its fields, a function or several"
            )
        found = tuple(one for each in value for one in cls.of(each))
        if sum(one.kind == "function" for one in found) > 1:
            raise ValueError(f"disturbance={short(value)} must have at most one function: let it add them up")
        if len(found) > _MOST:
            raise ValueError(f"disturbance={short(value)} must be at most {_MOST} at once, it is {len(found)}")
        return found

    @property
    def random(self) -> bool:
        """Whether it depends on an episode's key."""
        return self.kind == "noise" or any(isinstance(getattr(self, name), tuple) for name in DRAWN)

    def check(self, dt: float, horizon: float) -> None:
        """See that it acts in episodes of ``horizon`` seconds which are sampled every ``dt`` seconds.

        Raises:
            ValueError: it begins behind the end, or a pulse or half a sine is missed between two samples.
        """
        if self.ends("start")[1] >= horizon:
            raise ValueError(f"disturbance start={self.start!r} s must be less than the horizon={horizon!r} s")
        if self.kind == "pulses" and self.width < dt:
            raise ValueError(f"disturbance width={self.width!r} s must be at least a sampling period dt={dt!r} s")
        if self.kind == "sine" and self.ends("frequency")[1] > 0.5 / dt:
            raise ValueError(
                f"disturbance frequency={self.frequency!r} Hz must be at most {0.5 / dt:g} Hz, half the sampling rate"
            )


def part(disturbances: Sequence[Disturbance], n: int, dt: float) -> Part:
    """What disturbances put into a loop of n slots that is sampled every ``dt`` seconds, before the plant.

    Their sum is in the rows PUSH. Where it is not finite it is left out and fails the slot; the row REFUSED is then the
    time in s. :func:`begin` tells slots their episodes.
    """
    kinds = [float(KINDS.index(each.kind)) for each in disturbances]
    groups = np.zeros((len(kinds), pushing.GROUP))
    for group, each, kind in zip(groups, disturbances, kinds, strict=True):
        decay = 2.0 * math.pi * each.bandwidth * dt
        group[pushing.KIND], group[pushing.WIDTH] = kind, each.width
        group[pushing.KEPT], group[pushing.FRESH] = math.exp(-decay), math.sqrt(-math.expm1(-2.0 * decay))
    rows = columns(n, np.zeros(pushing.FIRST), groups.ravel())
    rows[pushing.DT], rows[pushing.HOW_MANY] = dt, len(kinds)
    begin(rows, slice(None), disturbances, np.zeros(n))
    functions = [each.function for each in disturbances if each.function is not None]
    return Part(rows, sample=pushing.push_with(*functions) if functions else pushing.push, alike=(dt, *kinds))


def begin(own: Array, slots: Slots, disturbances: Sequence[Disturbance], keys: Array) -> None:
    """Tell a part's rows, of some slots, the keys of their episodes, and draw what these have of each disturbance."""
    own[pushing.KEY, slots] = keys
    rows = (pushing.SIZE, pushing.SIZE + 1, pushing.START, pushing.FREQUENCY, pushing.PHASE)
    for d, each in enumerate(disturbances):
        drawn = uniforms(keys, [STREAMS * d + _DRAWS + j for j in range(len(DRAWN))])
        for row, name, u in zip(rows, DRAWN, drawn, strict=True):
            low, high = each.ends(name)
            own[pushing.FIRST + d * pushing.GROUP + row, slots] = low + (high - low) * u


def refused(loop: Loop) -> Array:
    """When in s the sum was not finite in each slot of a loop, (n,); 0 where it always has been."""
    return loop.own("disturbance")[pushing.REFUSED].copy() if "disturbance" in loop.parts else np.zeros(loop.n)


def _drawn(name: str, value: Any) -> Drawn:
    """A number, or a pair of which the first is at most the second."""
    shape = () if isinstance(value, str | Mapping) else shape_of(value)
    if shape == ():
        return number(name, value)
    if shape != (2,):
        raise ValueError(f"{name}={short(value)} must be a number or a pair (low, high)")
    low, high = (number(name, end) for end in value)
    if low > high:
        raise ValueError(f"{name}={short(value)} must have low at most high")
    return low, high


def _tried(function: Any) -> None:
    """See that a function takes and gives what it must, and that Numba can compile it."""
    if not isinstance(plain(function), FunctionType):
        raise ValueError(f"disturbance function={short(function)} must be a function, plain or compiled by Numba")
    try:
        inspect.signature(plain(function)).bind(*[0.0] * 5)
    except TypeError as error:
        raise ValueError(f"disturbance function={short(function)} {_TAKES}: {error}") from None
    if not COMPILES:
        return
    given = (types.float64,) * 5
    compiled = pushing.compiled(function)
    try:
        compiled.compile(given)
    except NumbaError as error:
        lines = re.sub(r"\x1b\[\d*m", "", str(error)).splitlines()
        why = next((line for line in lines if line.strip() and not line.startswith("Failed in nopython")), "")
        raise ValueError(f"disturbance function={short(function)} cannot be compiled by Numba: {why}") from error
    result = compiled.overloads[given].signature.return_type
    if [isinstance(each, _REAL) for each in getattr(result, "types", ())] != [True, True]:
        raise ValueError(f"disturbance function={short(function)} {_TAKES}, two numbers; it gives {result}")
