"""What becomes of the true positions on their way to the computer: one block, a pass over the lanes for each flaw.

All slots of a call have the same settings, so a pass reads them in lane 0 and is left out where they are off. Keys,
counts of samples and what is remembered of earlier ones differ from lane to lane.
:class:`~smo_gym.sensors.Sensor` says what each flaw is.
"""

from ..typing import Array
from . import inlined
from .batch import LANES
from .blocks import ALIVE, STAMP, Y0, X, Y, at, block, four, offsets, put, put_two, two
from .elementary import rounded
from .noise import STREAMS, two_normals, uniform

FOR_NOISE, FOR_JITTER, FOR_STUCK, FOR_LAG, FOR_HOLD, FOR_DROPOUT = 0, 2, 4, 6, 8, 10
"""Streams of random numbers, two each: for the two uniforms that make two normals, else for the two channels."""

KEY, COUNT = 0, 1
"""Rows: the key of the episode, and how many samples it has had."""
# fmt: off
(SCALE, BIAS, DEAD_ZONE, DEAD_WIDTH, STUCK, NOISE, SPEED_NOISE, RESOLUTION, UPDATE, DELAY, LEAST, HOLD, DROPOUT, JITTER,
 CUT, OUTSIDE, STUCK_AT, HELD, LAG, TO, FROM, DRAWN, REGISTER) = (2 + row for row in offsets(
     2, 2, 2, 2, 6, 2, 2, 2, 2, 2, 2, 2, 6, 1,
     1, 2, 2, 2, 2, 2, 2, 2))
# fmt: on
"""Rows of settings as in Sensor, of each channel, times in numbers of samples and 0 for off; behind the probability of
a fault how many samples it lasts and how many of them are left. Then what is remembered: the reading before the dead
zone, the one that is stuck, the one held until the next update, and the delay. Then scratch: places in the register,
two uniforms. Last the register of earlier readings, of h and of theta, whose length depends on the delays."""
_SAMPLES, _LEFT = 2, 4  # rows behind the one of a probability
TURN = 6.283185307179586


@inlined
def _drawn(own: Array, stream: int, i: int) -> float:
    """A number uniform in [0, 1) of this sample."""
    return uniform(at(own, KEY, i), STREAMS * at(own, COUNT, i) + stream)


@inlined
def _struck(own: Array, fault: int, chance: float, samples: float, stream: int, i: int) -> bool:
    """Whether this sample is one of some in a row that a fault strikes; never an episode's first."""
    left, count, drawn = at(own, fault + _LEFT, i), at(own, COUNT, i), _drawn(own, stream, i)
    begun = samples if (count > 0.0) & (drawn < chance) else 0.0
    now = left if left > 0.0 else begun
    put(own, fault + _LEFT, i, max(now - 1.0, 0.0))
    return now > 0.0


@inlined
def _draw_two(own: Array, lanes: int, stream: int) -> None:
    """Two uniforms in a pass of their own: with what is made of them, they need more registers than there are."""
    for i in range(lanes):
        put_two(own, DRAWN, i, (_drawn(own, stream, i), _drawn(own, stream + 1, i)))


@inlined
def _jitter(signals: Array, own: Array, lanes: int) -> None:
    deviation, cut = own[JITTER * LANES], own[CUT * LANES]
    _draw_two(own, lanes, FOR_JITTER)
    for i in range(lanes):
        normal, _ = two_normals(*two(own, DRAWN, i))
        put(signals, STAMP, i, min(max(deviation * normal, -cut), cut))


@inlined
def _take(signals: Array, own: Array, lanes: int) -> None:
    scale, bias = two(own, SCALE, 0), two(own, BIAS, 0)
    for i in range(lanes):
        (h, theta, v, omega), late = four(signals, X, i), at(signals, STAMP, i)
        put_two(signals, Y0, i, two(signals, Y, i))
        put_two(signals, Y, i, (scale[0] * (h + late * v) + bias[0], scale[1] * (theta + late * omega) + bias[1]))


@inlined
def _skip_dead_zone(signals: Array, own: Array, lanes: int, c: int) -> None:
    start, width = own[(DEAD_ZONE + c) * LANES], own[(DEAD_WIDTH + c) * LANES]
    turn = own[(SCALE + c) * LANES] * TURN  # of the rod, as the scale would have it
    for i in range(lanes):
        y = at(signals, Y + c, i)
        turns = c * rounded((y - start) / turn - 0.5)
        beyond = y - start - turn * turns
        outside, count = at(own, OUTSIDE + c, i), at(own, COUNT, i)
        last = outside if count > 0.0 else start + TURN * turns
        counted = y - c * (turn - TURN) * (turns + 1.0)
        y = last if (beyond >= 0.0) & (beyond < width) else counted
        put(own, OUTSIDE + c, i, y)
        put(signals, Y + c, i, y)


@inlined
def _stick(signals: Array, own: Array, lanes: int, c: int) -> None:
    chance, samples = own[(STUCK + c) * LANES], own[(STUCK + c + _SAMPLES) * LANES]
    for i in range(lanes):
        last, y = at(own, STUCK_AT + c, i), at(signals, Y + c, i)
        y = last if _struck(own, STUCK + c, chance, samples, FOR_STUCK + c, i) else y
        put(own, STUCK_AT + c, i, y)
        put(signals, Y + c, i, y)


@inlined
def _add_noise(signals: Array, own: Array, lanes: int) -> None:
    fixed, growing = two(own, NOISE, 0), two(own, SPEED_NOISE, 0)
    _draw_two(own, lanes, FOR_NOISE)
    for i in range(lanes):
        a, b = two_normals(*two(own, DRAWN, i))
        y, (_, _, v, omega) = two(signals, Y, i), four(signals, X, i)
        deviation = fixed[0] + growing[0] * abs(v), fixed[1] + growing[1] * abs(omega)
        put_two(signals, Y, i, (y[0] + deviation[0] * a, y[1] + deviation[1] * b))


@inlined
def _quantise(signals: Array, own: Array, lanes: int, c: int) -> None:
    count = own[(RESOLUTION + c) * LANES]
    inverse = 1.0 / count
    for i in range(lanes):
        put(signals, Y + c, i, count * rounded(at(signals, Y + c, i) * inverse))


@inlined
def _wait_for_update(signals: Array, own: Array, lanes: int, c: int) -> None:
    every = own[(UPDATE + c) * LANES]
    inverse = 1.0 / every
    for i in range(lanes):
        count, new, held = at(own, COUNT, i), at(signals, Y + c, i), at(own, HELD + c, i)
        y = new if every * rounded(count * inverse) == count else held
        put(own, HELD + c, i, y)
        put(signals, Y + c, i, y)


@inlined
def _draw_lag(own: Array, lanes: int, c: int) -> None:
    least, hold = own[(LEAST + c) * LANES], own[(HOLD + c) * LANES]
    choices = own[(DELAY + c) * LANES] - least + 1.0
    for i in range(lanes):
        lag, count = at(own, LAG + c, i), at(own, COUNT, i)
        drawn, kept = _drawn(own, FOR_LAG + c, i), _drawn(own, FOR_HOLD + c, i) < hold
        put(own, LAG + c, i, lag if (count > 0.0) & kept else least + rounded(choices * drawn - 0.5))


@inlined
def _place(number: float, places: float, inverse: float) -> float:
    """The remainder of a whole number, from 0 to places - 1."""
    rest = number - places * rounded(number * inverse)
    return rest + places if rest < 0.0 else rest


@inlined
def _delay(signals: Array, own: Array, lanes: int, c: int) -> None:
    """Sample k is kept in place k mod (delay + 1): to shift 20 of them takes some five times as long."""
    places = own[(DELAY + c) * LANES] + 1.0
    inverse = 1.0 / places
    register = own[(REGISTER + c * (1 + int(own[DELAY * LANES]))) * LANES :]
    for i in range(lanes):
        count, lag = at(own, COUNT, i), at(own, LAG + c, i)
        put(own, TO + c, i, _place(count, places, inverse))
        put(own, FROM + c, i, _place(max(count - lag, 0.0), places, inverse))
    for i in range(lanes):
        register[int(at(own, TO + c, i)) * LANES + i] = at(signals, Y + c, i)
        put(signals, Y + c, i, register[int(at(own, FROM + c, i)) * LANES + i])


@inlined
def _lose(signals: Array, own: Array, lanes: int, c: int) -> None:
    chance, samples = own[(DROPOUT + c) * LANES], own[(DROPOUT + c + _SAMPLES) * LANES]
    for i in range(lanes):
        last, y = at(signals, Y0 + c, i), at(signals, Y + c, i)
        put(signals, Y + c, i, last if _struck(own, DROPOUT + c, chance, samples, FOR_DROPOUT + c, i) else y)


@inlined
def _deliver(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going, (h0, theta0), (h, theta) = at(signals, ALIVE, i) > 0.0, two(signals, Y0, i), two(signals, Y, i)
        put_two(signals, Y, i, (h if going else h0, theta if going else theta0))
        put(own, COUNT, i, at(own, COUNT, i) + 1.0)


@inlined
def _before_noise(signals: Array, own: Array, lanes: int, c: int) -> None:
    if own[(DEAD_WIDTH + c) * LANES] > 0.0:
        _skip_dead_zone(signals, own, lanes, c)
    if own[(STUCK + c) * LANES] > 0.0:
        _stick(signals, own, lanes, c)


@inlined
def _after_noise(signals: Array, own: Array, lanes: int, c: int) -> None:
    if own[(RESOLUTION + c) * LANES] > 0.0:
        _quantise(signals, own, lanes, c)
    if own[(UPDATE + c) * LANES] > 1.0:
        _wait_for_update(signals, own, lanes, c)
    if own[(DELAY + c) * LANES] > own[(LEAST + c) * LANES]:
        _draw_lag(own, lanes, c)
    if own[(DELAY + c) * LANES] > 0.0:
        _delay(signals, own, lanes, c)
    if own[(DROPOUT + c) * LANES] > 0.0:
        _lose(signals, own, lanes, c)


@block
def sense(signals: Array, own: Array, lanes: int) -> None:
    """One sample of both channels; runs that have ended keep their last reading."""
    if own[JITTER * LANES] > 0.0:
        _jitter(signals, own, lanes)
    _take(signals, own, lanes)
    _before_noise(signals, own, lanes, 0)
    _before_noise(signals, own, lanes, 1)
    if own[NOISE * LANES] + own[(NOISE + 1) * LANES] + own[SPEED_NOISE * LANES] + own[(SPEED_NOISE + 1) * LANES] > 0.0:
        _add_noise(signals, own, lanes)
    _after_noise(signals, own, lanes, 0)
    _after_noise(signals, own, lanes, 1)
    _deliver(signals, own, lanes)
