"""What becomes of the force that a law wants, on its way to the cart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .kernels import inlined
from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, FORCE, U, at, block, offsets, put
from .kernels.elementary import rounded, within
from .loop import Part, columns
from .typing import Array
from .validation import instance, number, short, switch, whole

LIMIT, REFUSED, ASKED, COMMAND, PLACE, RAMP, LAG, SETTINGS, REGISTER = offsets(1, 1, 1, 1, 1, 1, 1, 7)
RESOLUTION, MOST, DELAY, DEAD_ZONE, STEP, KEPT, MEAN = range(SETTINGS, REGISTER)
"""Own rows: the force that is asked for and the one of the converter; where in the register the oldest force on its way
is, behind which the next comes; what rate limit and lag have come to. Then what is alike in all slots: MOST is the
converter's largest multiple within the limit, STEP how far the force may go in a sampling period; of its distance from
its input the lag has KEPT at the end of one, and MEAN on average over it. Last the register: the forces on their
way."""
_FINEST = 1e-12  # of a resolution: finer ones are lost in the rounding of float64


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
def _ask(signals: Array, own: Array, lanes: int) -> None:
    resolution, most = own[RESOLUTION * LANES], own[MOST * LANES]
    for i in range(lanes):
        wanted, limit, alive = at(signals, U, i), at(own, LIMIT, i), at(signals, ALIVE, i) > 0.0
        fine = math.isfinite(wanted)
        force = min(max(wanted, -limit), limit)
        force = force if fine and alive else 0.0
        put(signals, U, i, force)
        put(own, ASKED, i, force)
        put(own, COMMAND, i, force)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put(own, REFUSED, i, wanted if alive and not fine else at(own, REFUSED, i))
    if resolution > 0.0:
        for i in range(lanes):
            put(own, COMMAND, i, within(resolution * rounded(at(own, COMMAND, i) / resolution), -most, most))


@inlined
def _skip_dead_zone(signals: Array, own: Array, lanes: int) -> None:
    zone = own[DEAD_ZONE * LANES]
    for i in range(lanes):
        force = at(own, COMMAND, i)
        put(signals, FORCE, i, force - within(force, -zone, zone))


@inlined
def _wait(signals: Array, own: Array, lanes: int) -> None:
    delay = own[DELAY * LANES]
    for i in range(lanes):
        oldest, force = REGISTER + int(at(own, PLACE, i)), at(signals, FORCE, i)
        put(signals, FORCE, i, at(own, oldest, i))
        put(own, oldest, i, force)
    for i in range(lanes):
        place = at(own, PLACE, i) + 1.0
        put(own, PLACE, i, place if place < delay else 0.0)


@inlined
def _climb(signals: Array, own: Array, lanes: int) -> None:
    step = own[STEP * LANES]
    for i in range(lanes):
        before = at(own, RAMP, i)
        force = within(at(signals, FORCE, i), before - step, before + step)
        put(own, RAMP, i, force)
        put(signals, FORCE, i, force)


@inlined
def _lag(signals: Array, own: Array, lanes: int) -> None:
    kept, mean = own[KEPT * LANES], own[MEAN * LANES]
    for i in range(lanes):
        to = at(signals, FORCE, i)
        behind = at(own, LAG, i) - to
        put(own, LAG, i, to + kept * behind)
        put(signals, FORCE, i, to + mean * behind)


@inlined
def _rest(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        force, alive = at(signals, FORCE, i), at(signals, ALIVE, i) > 0.0
        put(signals, FORCE, i, force if alive else 0.0)


@block
def _reach(signals: Array, own: Array, lanes: int) -> None:
    _skip_dead_zone(signals, own, lanes)  # it does not matter whether it comes before the delay
    if own[DELAY * LANES] > 0.0:
        _wait(signals, own, lanes)
    if own[STEP * LANES] < math.inf:
        _climb(signals, own, lanes)
    if own[MEAN * LANES] > 0.0:
        _lag(signals, own, lanes)
    _rest(signals, own, lanes)


@block
def _restore(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put(signals, U, i, at(own, ASKED, i))


@block
def _measure(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        force, alive = at(signals, FORCE, i), at(signals, ALIVE, i) > 0.0
        put(signals, U, i, force if alive else 0.0)


def force_sensor(n: int) -> Part:
    """Tells observers the force that reaches the cart in place of what was asked for."""
    return Part(np.empty((0, n)), sample=_measure)


@dataclass(frozen=True, slots=True)
class Actuator:
    """What stands between the force that is asked for and the one that reaches the cart; by default nothing.

    A force u, within the environment's ``force_limit``, is held over a control period and becomes in this order

    ::

        resolution      u = the nearest multiple of it         within the limit, too
        delay           u = the one of so many sampling periods ago    0 before the first
        dead zone       u = sgn(u) max(|u| - dead_zone, 0)
        rate limit      u = what is nearest to it within dt rate_limit of the one before, at each sampling instant
        lag             time_constant f' = u - f                       exact for the held u
        back-EMF        F = f - back_emf h'                            in the plant's equations of motion

    f and F begin at 0. The row FORCE is F on average over a sampling period, to which the cart answers: with the lag f
    goes from f_0 to ``u + (f_0 - u) e^-r``, r = dt / time_constant, and is ``u + (f_0 - u) (1 - e^-r) / r`` on average.

    Args:
        unit: N per unit of command. What `step` takes is in that unit, forces everywhere else in N: agents say
            newtons, which the harness divides by it, and so must who steps by hand.
        resolution: one step of the converter in N, None for none.
        delay: in whole sampling periods.
        dead_zone: in N, as of dry friction in a gear.
        rate_limit: in N/s, None for none.
        time_constant: in s, as of a motor's winding.
        back_emf: in N per m/s of the cart.
        measured: whether observers are told the force that reaches the cart, as by a force sensor, in place of the one
            that is asked for. Metrics are of the one that is asked for.

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
        set_(self, "resolution", _or_none("actuator resolution", self.resolution, _FINEST))
        set_(self, "delay", whole("actuator delay", self.delay, 0))
        set_(self, "rate_limit", _or_none("actuator rate_limit", self.rate_limit, 0.0))
        for name in ("dead_zone", "time_constant", "back_emf"):
            set_(self, name, number(f"actuator {name}", getattr(self, name)))
            if getattr(self, name) < 0.0:
                raise ValueError(f"actuator {name}={getattr(self, name)!r} must be at least 0")
        set_(self, "measured", switch("actuator measured", self.measured))

    @classmethod
    def of(cls, actuator: Actuator | Mapping[str, Any] | None) -> Actuator:
        """An actuator from an actuator, a mapping of field names or None for the ideal one.

        Raises:
            ValueError: an unknown field, or a value that is not allowed.
        """
        return instance(cls, "actuator setting", actuator)

    @property
    def ideal(self) -> bool:
        """Whether the force that is asked for reaches the cart as it is, and nothing measures it."""
        return self == Actuator(unit=self.unit)

    def check(self, dt: float, horizon: float) -> None:
        """See that the actuator can serve episodes of ``horizon`` seconds which are sampled every ``dt`` seconds.

        Raises:
            ValueError: the delay is as long as the episode.
        """
        if self.delay * dt >= horizon:
            raise ValueError(
                f"actuator delay={self.delay} samples of dt={dt!r} s must be less than the horizon={horizon!r} s"
            )

    def part(self, n: int, limit: float, dt: float) -> Part:
        """What the actuator puts into a loop of n slots that is sampled every ``dt`` seconds.

        Forces are limited and refused as by :func:`limited`. Where they are measured, the loop needs a
        :func:`force_sensor`, too.
        """
        kept, mean = 0.0, 0.0
        if self.time_constant > 0.0:
            ratio = dt / self.time_constant
            kept, mean = math.exp(-ratio), -math.expm1(-ratio) / ratio
        step = math.inf if self.rate_limit is None else self.rate_limit * dt
        resolution = self.resolution or 0.0
        multiples = limit / resolution if resolution else math.inf
        most = resolution * math.floor(multiples) if multiples < math.inf else math.inf
        settings = (resolution, most, float(self.delay), self.dead_zone, step, kept, mean)
        rows = columns(n, limit, np.zeros(SETTINGS - REFUSED), settings, np.zeros(self.delay))
        return Part(rows, act=_ask, sample=_reach, close=_restore if self.measured else None, alike=settings)


def _or_none(name: str, value: Any, least: float) -> float | None:
    """A positive number of at least ``least``, or None."""
    if value is None:
        return None
    found = number(name, value)
    if found < least or found <= 0.0:
        allowed = f"at least {least:g}" if least > 0.0 else "greater than 0"
        raise ValueError(f"{name}={short(value)} must be {allowed}, or None for none")
    return found
