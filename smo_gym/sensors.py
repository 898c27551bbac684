"""What the computer is told of the positions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from .kernels import sensing
from .kernels.blocks import Y0, X, Y, block, put_two, two
from .kernels.sensing import KEY as KEY
from .loop import Part, columns
from .typing import Array
from .validation import instance, multiple, number, shape_of, short, whole

Pair = tuple[float, float]
Counts = tuple[int, int]

CHANNELS = ("h", "theta")
_FINEST = 1e-12  # of a resolution: finer ones are lost in the rounding of float64


@block
def _exact(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put_two(signals, Y0, i, two(signals, Y, i))
        put_two(signals, Y, i, two(signals, X, i))


def exact(n: int) -> Part:
    """Encoders without any error: y = [h, theta] at every sampling instant."""
    return Part(np.empty((0, n)), sample=_exact)


@dataclass(frozen=True, slots=True)
class Sensor:
    """Encoders of the cart and the rod and their line to the computer; by default without any error.

    Each setting but ``jitter`` is a pair (h, theta), in m or rad where it says "units". The k-th sample of an episode,
    k = 0 at its very start, becomes in this order

    ::

        jitter          y = x(t_k + tau) = x + tau x'         tau normal, cut at half a sampling period
        scale, bias     y = scale y + bias
        dead zone       y = the last reading outside          while y is in [dead_zone, dead_zone + dead_width)
                        y = y - n 2 pi (scale - 1)            theta beyond the n-th zone
        stuck           y = the one before                    for stuck_samples samples, with probability stuck
        noise           y = y + (noise + speed_noise |x'|) w  w standard normal, white, of each channel its own
        resolution      y = the nearest multiple of it
        update period   y = the one of the last update        updates at t = 0 and every update_period
        delay           y = the one of sample k - d           the first one for k < d
        dropout         y = what was delivered last           for dropout_samples samples, with probability dropout

    The first reading of an episode is never stuck or lost, and where it is in a dead zone it is where that zone begins.
    Runs that have ended keep their last reading.

    Args:
        scale: factor of the position, 1 for none.
        bias: in units.
        dead_zone: where a potentiometer's gap begins, as a reading in units; that of theta is met in every turn of the
            rod. Its reading is then of an angle within a turn, and turns are counted as 2 pi: the scale is within one.
        dead_width: width of the gap as a reading in units, 0 for none; that of theta is less than a turn.
        stuck: probability per sample that the sensor sticks; noise and what follows go on.
        stuck_samples: how many samples it then sticks for.
        noise: standard deviation in units.
        speed_noise: what the true speed adds to that, in units per unit/s.
        resolution: one count in units, None for none: of both, or in place of either number.
        update_period: time in s between two new readings, a multiple of the sampling period; 0 for every sample.
        delay: in whole samples.
        delay_least: None for a fixed delay; else it is drawn evenly from delay_least, ..., delay at each sample, so
            that readings may overtake each other.
        hold: probability per sample that the delay is not drawn but stays what it was.
        dropout: probability per sample that it is lost.
        dropout_samples: how many samples in a row are then lost.
        jitter: standard deviation of the sampling instant in s, common to both. The row STAMP tells tau.

    Raises:
        ValueError: a value is not allowed.
    """

    scale: Pair = (1.0, 1.0)
    bias: Pair = (0.0, 0.0)
    dead_zone: Pair = (0.0, 0.0)
    dead_width: Pair = (0.0, 0.0)
    stuck: Pair = (0.0, 0.0)
    stuck_samples: Counts = (1, 1)
    noise: Pair = (0.0, 0.0)
    speed_noise: Pair = (0.0, 0.0)
    resolution: tuple[float | None, float | None] | None = None
    update_period: Pair = (0.0, 0.0)
    delay: Counts = (0, 0)
    delay_least: Counts | None = None
    hold: Pair = (0.0, 0.0)
    dropout: Pair = (0.0, 0.0)
    dropout_samples: Counts = (1, 1)
    jitter: float = 0.0

    @classmethod
    def of(cls, sensor: Sensor | Mapping[str, Any] | None) -> Sensor:
        """A sensor from a sensor, a mapping of field names or None (without any error).

        Raises:
            ValueError: an unknown field, or a value that is not allowed.
        """
        return instance(cls, "sensor setting", sensor)

    def __post_init__(self) -> None:
        for name in ("scale", "bias", "dead_zone"):
            self._set(name, number)
        for name in ("noise", "speed_noise", "dead_width", "update_period"):
            self._set(name, _size)
        for name in ("stuck", "hold", "dropout"):
            self._set(name, _probability)
        for name, least in (("stuck_samples", 1), ("dropout_samples", 1), ("delay", 0)):
            self._set(name, partial(whole, least=least))
        if self.resolution is not None:
            self._set("resolution", _count)
        object.__setattr__(self, "jitter", _size("sensor jitter", self.jitter))
        if not self.dead_width[1] < sensing.TURN:
            raise ValueError(f"sensor dead_width of theta={self.dead_width[1]!r} must be less than a turn, 2 pi")
        if self.dead_width[1] > 0.0 and not self.scale[1] > 0.0:
            raise ValueError(f"sensor scale of theta={self.scale[1]!r} must be positive where theta has a dead_width")
        self._check_least()

    def _set(self, name: str, checked: Callable[[str, Any], Any]) -> None:
        """Replace a setting by the pair of its checked values."""
        pair = getattr(self, name)
        if isinstance(pair, str | Mapping) or shape_of(pair) != (2,):
            raise ValueError(f"sensor {name}={short(pair)} must be a pair (h, theta)")
        values = tuple(checked(f"sensor {name} of {of}", value) for of, value in zip(CHANNELS, pair, strict=True))
        object.__setattr__(self, name, values)

    def _check_least(self) -> None:
        if self.delay_least is None:
            if max(self.hold) > 0.0:
                raise ValueError(f"sensor hold={self.hold} must be 0 where the delay is fixed: set delay_least, too")
            return
        self._set("delay_least", partial(whole, least=0))
        for of, least, most in zip(CHANNELS, self.delay_least, self.delay, strict=True):
            if least > most:
                raise ValueError(f"sensor delay_least of {of}={least} must be at most its delay={most}")

    @property
    def exact(self) -> bool:
        """Whether the readings are the true positions."""
        sizes = (*self.bias, *self.dead_width, *self.noise, *self.speed_noise, *self.update_period, *self.delay)
        chances = (*self.stuck, *self.dropout)
        return self.scale == (1.0, 1.0) and not any((*sizes, *chances, *(self.resolution or ()), self.jitter))

    @property
    def random(self) -> bool:
        """Whether readings depend on an episode's key."""
        chances = (*self.noise, *self.speed_noise, *self.stuck, *self.dropout, self.jitter)
        return max(chances) > 0.0 or (self.delay_least or self.delay) != self.delay

    def check(self, dt: float, horizon: float) -> None:
        """See that the sensor can serve episodes of ``horizon`` seconds which are sampled every ``dt`` seconds.

        Raises:
            ValueError: an update period is no multiple of ``dt``, or a delay is as long as the episode.
        """
        self._updates(dt)
        for of, delay in zip(CHANNELS, self.delay, strict=True):
            if delay * dt >= horizon:
                raise ValueError(
                    f"sensor delay of {of}={delay} samples of dt={dt!r} s must be less than the horizon={horizon!r} s"
                )

    def _updates(self, dt: float) -> list[int]:
        """Samples from one update to the next."""
        return [
            multiple(f"sensor update_period of {of}", period, "the sampling period dt", dt) if period > 0.0 else 1
            for of, period in zip(CHANNELS, self.update_period, strict=True)
        ]

    def part(self, n: int, dt: float) -> Part:
        """What the sensor puts into a loop of n slots that is sampled every ``dt`` seconds.

        Its row ``KEY`` is the key of the slot's episode, a whole number in [0, 2^52): random numbers are a
        function of it, the number of the sample in the episode and the channel alone.

        Raises:
            ValueError: an update period is no multiple of ``dt``.
        """
        if self.exact:
            return exact(n)
        least = self.delay if self.delay_least is None else self.delay_least
        resolution = [count or 0.0 for count in self.resolution or (None, None)]
        settings = [
            *(self.scale, self.bias, self.dead_zone, self.dead_width, self.stuck, self.stuck_samples, (0.0, 0.0)),
            *(self.noise, self.speed_noise, resolution, self._updates(dt), self.delay, least, self.hold),
            *(self.dropout, self.dropout_samples, (0.0, 0.0), (self.jitter, 0.5 * dt)),
        ]
        column = np.zeros(sensing.REGISTER + 2 + sum(self.delay))
        column[sensing.SCALE : sensing.OUTSIDE] = np.concatenate(settings)
        column[sensing.LAG : sensing.TO] = least
        alike = tuple(column[: sensing.OUTSIDE].tolist())
        return Part(columns(n, column), sample=sensing.sense, alike=alike, reads=True)


def _size(name: str, value: Any) -> float:
    found = number(name, value)
    if found < 0.0:
        raise ValueError(f"{name}={short(value)} must be at least 0")
    return found


def _probability(name: str, value: Any) -> float:
    found = number(name, value)
    if not 0.0 <= found <= 1.0:
        raise ValueError(f"{name}={short(value)} must be a probability in [0, 1]")
    return found


def _count(name: str, value: Any) -> float | None:
    """One count of an encoder, or None."""
    if value is None:
        return None
    found = number(name, value)
    if found < _FINEST:
        raise ValueError(f"{name}={short(value)} must be at least {_FINEST:g}, or None for no quantisation")
    return found
