"""What becomes of the force that a law wants, on its way to the cart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, FORCE, U, at, block, offsets, put
from .kernels.elementary import rounded
from .loop import Part, columns
from .typing import Array
from .validation import mapping, number, switch, whole

LIMIT, REFUSED, ASKED, TARGET, RATE, LAG, GAINS, SETTINGS, DELAYED = offsets(1, 1, 1, 1, 1, 1, 2, 4)
_RESOLUTION, _ZONE, _RATE_LIMIT, _DELAY = (SETTINGS + k for k in range(4))
"""Own rows; behind them the forces that are on their way, the newest first."""


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


@block
def _asked(signals: Array, own: Array, lanes: int) -> None:
    resolution = own[_RESOLUTION * LANES]
    for i in range(lanes):
        wanted, limit, alive = at(signals, U, i), at(own, LIMIT, i), at(signals, ALIVE, i) > 0.0
        fine = math.isfinite(wanted)
        force = min(max(wanted, -limit), limit)
        force = force if fine and alive else 0.0
        put(signals, U, i, force)
        put(own, ASKED, i, force)
        put(own, TARGET, i, force)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put(own, REFUSED, i, wanted if alive and not fine else at(own, REFUSED, i))
    if resolution > 0.0:
        for i in range(lanes):
            put(own, TARGET, i, resolution * rounded(at(own, TARGET, i) / resolution))


@block
def _reach(signals: Array, own: Array, lanes: int) -> None:
    delay = int(own[_DELAY * LANES])
    zone, rate = own[_ZONE * LANES], own[_RATE_LIMIT * LANES]
    kept, mean = own[GAINS * LANES], own[(GAINS + 1) * LANES]
    last = DELAYED + delay - 1 if delay > 0 else TARGET
    for i in range(lanes):
        # what moves out of the delay, less the dead zone
        come = at(own, last, i)
        come = math.copysign(max(abs(come) - zone, 0.0), come)
        # no faster than the rate limit
        before = at(own, RATE, i)
        now = before + min(max(come - before, -rate), rate)
        put(own, RATE, i, now)
        # the exact lag over the step, and its mean
        behind = at(own, LAG, i) - now
        put(own, LAG, i, now + kept * behind)
        put(signals, FORCE, i, now + mean * behind)
    for k in range(delay):
        to, of = DELAYED + delay - 1 - k, DELAYED + delay - 2 - k if k < delay - 1 else TARGET
        for i in range(lanes):
            put(own, to, i, at(own, of, i))


@block
def _restore(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put(signals, U, i, at(own, ASKED, i))


@block
def _measure(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put(signals, U, i, at(signals, FORCE, i))


def force_sensor(n: int) -> Part:
    """Tells observers the force that reaches the cart in place of what was asked for."""
    return Part(np.empty((0, n)), sample=_measure)


@dataclass(frozen=True, slots=True)
class Actuator:
    """What stands between the force that is asked for and the one that reaches the cart.

    In this order: the environment's ``force_limit``; steps of ``resolution``; a delay of ``delay`` sampling periods; a
    dead zone, u -> sgn(u) max(|u| - dead_zone, 0); a rate limit; a first-order lag T f' = u - f, exact for the held u,
    of which the cart feels the mean over each integration step; and f - back_emf h', which stands in the plant's
    right-hand side, since it depends on the cart's speed.

    Args:
        unit: N per unit of command. Actions of the environment are in that unit, forces everywhere else in N.
        resolution: of the command in N; None for none.
        delay: in whole sampling periods.
        dead_zone: in N.
        rate_limit: in N/s; None for none.
        time_constant: T in s.
        back_emf: in N s/m.
        measured: whether observers are told the force that reaches the cart, as by a current or force sensor, and not
            the one that was asked for.

    Raises:
        ValueError: a value is not allowed.
    """

    unit: float = 1.0
    resolution: float | None = None
    delay: int = 0
    dead_zone: float = 0.0
    rate_limit: float | None = None
    time_constant: float = 0.0
    back_emf: float = 0.0
    measured: bool = False

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "unit", number("actuator unit", self.unit, above=0.0))
        for name in ("resolution", "rate_limit"):
            if getattr(self, name) is not None:
                set_(self, name, number(f"actuator {name}", getattr(self, name), above=0.0))
        for name in ("dead_zone", "time_constant", "back_emf"):
            set_(self, name, number(f"actuator {name}", getattr(self, name)))
            if getattr(self, name) < 0.0:
                raise ValueError(f"actuator {name}={getattr(self, name)!r} must be at least 0")
        set_(self, "delay", whole("actuator delay", self.delay, 0))
        set_(self, "measured", switch("actuator measured", self.measured))

    @classmethod
    def of(cls, actuator: Actuator | Mapping[str, Any] | None) -> Actuator:
        """An actuator from itself, a mapping of field names or None for the ideal one.

        Raises:
            ValueError: an unknown field, or a value that is not allowed.
        """
        if isinstance(actuator, Actuator):
            return actuator
        return cls(**mapping("actuator setting", actuator or {}, [field.name for field in fields(cls)]))

    @property
    def ideal(self) -> bool:
        """Whether the force that is asked for, within the limit, reaches the cart as it is."""
        return self == Actuator(unit=self.unit)

    def check(self, dt: float, horizon: float) -> None:
        """See that the actuator can work at a sampling period in an episode, both in s.

        Raises:
            ValueError: the delay is as long as the episode.
        """
        if self.delay * dt >= horizon:
            raise ValueError(
                f"actuator delay={self.delay} sampling periods of {dt:g} s must be shorter than the episode of {horizon:g} s"
            )

    def part(self, n: int, limit: float, dt: float) -> Part:
        """What the actuator puts into a loop of n slots with a force limit in N and a sampling period in s."""
        kept, mean = 0.0, 0.0
        if self.time_constant > 0.0:
            ratio = dt / self.time_constant
            kept, mean = math.exp(-ratio), -math.expm1(-ratio) / ratio
        rate = math.inf if self.rate_limit is None else self.rate_limit * dt
        settings = (self.resolution or 0.0, self.dead_zone, rate, float(self.delay))
        rows = columns(n, limit, np.zeros(LAG - LIMIT), (kept, mean), settings, np.zeros(self.delay))
        close = _restore if self.measured else None
        return Part(rows, act=_asked, sample=_reach, close=close, alike=(kept, mean, *settings))
