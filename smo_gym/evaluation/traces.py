"""Who looks on at a rollout, and what is kept of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from ..envs.desired import Desired
from ..envs.task import Task
from ..kernels.blocks import U, at, block, offsets, put
from ..loop import Loop, Part, columns
from ..typing import Array


class Recorder(Protocol):
    """Looks on at a rollout: it changes nothing."""

    @property
    def every(self) -> int:
        """Control periods from one look to the next."""
        ...

    def look(self, k: int, loop: Loop) -> None:
        """See the loop at control instant k, the start included; what it shows is overwritten later."""
        ...


@dataclass(frozen=True, slots=True)
class Watch:
    """All who look on, and whom progress is told."""

    recorders: Sequence[Recorder]
    progress: Callable[[int], object]

    @property
    def stride(self) -> int:
        """Control periods that may pass unseen; 0 where nobody looks on."""
        return math.gcd(*(recorder.every for recorder in self.recorders))

    def look(self, k: int, loop: Loop) -> None:
        """Show the loop at control instant k to those whose turn it is."""
        for recorder in self.recorders:
            if k % recorder.every == 0:
                recorder.look(k, loop)


@dataclass(frozen=True, slots=True)
class Traces:
    """Some slots of a rollout at every so many control instants, the start included."""

    time: Array
    """The control instants in s, (m,)."""
    x: Array
    """True states [h, theta, h', theta'] in m, rad, m/s, rad/s, (m, 4, n)."""
    xhat: Array
    """Estimates of the states, in the same units, (m, 4, n); NaN where the environment has no observer."""
    u: Array
    """Force in N over the control period that ended at ``time``, (m, n)."""
    u_low: Array
    """The least force in N since the instant before, (m, n): a force can chatter faster than what is kept of it."""
    u_high: Array
    """The largest force in N since the instant before, (m, n)."""
    u_mean: Array
    """The mean force in N since the instant before, (m, n): what a force that chatters does to the cart."""
    x_d: Array | None
    """The reference x_d in m, rad, m/s, rad/s, (m, 4); None where there is none."""
    y: Array | None = None
    """What was measured, [h, theta] in m and rad, (m, 2, n); None where the sensors are exact."""

    def in_rows(self) -> Traces:
        """The same laid out in memory as from a file or another process: sums over them have the same bits."""
        return replace(self, **{name: np.ascontiguousarray(each) for name, each in self._by_name() if each is not None})

    def split(self, sizes: Sequence[int]) -> list[Traces]:
        """Traces of the first so many slots, of the next, and so on."""
        apart = {
            name: np.split(values, np.cumsum(sizes)[:-1], axis=-1)
            for name, values in self._by_name()
            if values is not None and name not in ("time", "x_d")
        }
        return [replace(self, **{name: parts[i] for name, parts in apart.items()}) for i in range(len(sizes))]

    def _by_name(self) -> list[tuple[str, Any]]:
        return [(field.name, getattr(self, field.name)) for field in fields(self)]


LOW, HIGH, SUM, COUNT, _ = offsets(1, 1, 1, 1)


@block
def _forces(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        u, low, high = at(signals, U, i), at(own, LOW, i), at(own, HIGH, i)
        put(own, LOW, i, min(low, u))
        put(own, HIGH, i, max(high, u))
        put(own, SUM, i, at(own, SUM, i) + u)
        put(own, COUNT, i, at(own, COUNT, i) + 1.0)


def forces(n: int) -> Part:
    """Lowest, highest, sum and number of the forces since the last look."""
    return Part(columns(n, np.inf, -np.inf, 0.0, 0.0), close=_forces)


class Tracer:
    """Keeps traces; its loop has the part :func:`forces`.

    Args:
        every: control periods from one kept instant to the next.
        slots: the slots to keep; None for all.
    """

    def __init__(self, every: int, slots: Sequence[int] | None, task: Task) -> None:
        self.every, self._task = every, task
        self._slots = slice(None) if slots is None else np.asarray(slots, dtype=np.intp)
        self._rows: list[tuple[Array, ...]] = []

    def look(self, k: int, loop: Loop) -> None:
        """Keep what the loop shows at control instant k."""
        mine, time = self._slots, np.array(k * self._task.control_period)
        u = loop.u[mine].copy()
        low, high, mean = u, u, u
        if k > 0:
            low, high, total, count = loop.own("forces")[:, mine].copy()
            short = count < self.every  # the driver leaves slots that have all ended: the rest is zero
            low, high = np.where(short, np.minimum(low, 0.0), low), np.where(short, np.maximum(high, 0.0), high)
            mean = total / self.every
        loop.restart("forces", slice(None))
        self._rows.append(
            (time, loop.x[:, mine].copy(), loop.xhat[:, mine].copy(), u, low, high, mean, loop.y[:, mine].copy())
        )

    def traces(self) -> Traces:
        """All that was kept, instant by instant."""
        time, x, xhat, u, low, high, mean, y = (np.array(column) for column in zip(*self._rows, strict=True))
        reference = self._task.reference
        told = None if reference is None else Desired(self._task, reference).states[:: self.every][: len(time)]
        return Traces(time, x, xhat, u, low, high, mean, told, None if self._task.sensor.exact else y)
