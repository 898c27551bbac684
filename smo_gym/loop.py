"""The closed loop of n slots: rows that components exchange and own, and what is called on them.

::

    act       a control period begins   law, actuator                        from xhat to u
    sample    at every sampling instant actuator, disturbance, plant         from u to x
                                        sensor, observer                     from x to y, xhat
    close     the control period ends   guard, metrics, end                  what is said of it

A component puts a :class:`Part` into the loop; the loop owns the rows. It is driven whole control periods at a time by
one compiled function, whatever its parts are, and a slot's bits depend neither on how many periods one call drives nor
on the other slots or the number of threads.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernels.batch import LANES, for_slots
from .kernels.blocks import ALIVE, FAILED, FORCE, REWARD, SIGNALS, XD, XHAT, Y0, Block, U, X, Y, address
from .kernels.driver import drive
from .typing import Array, Flags

ROLES = ("law", "actuator", "disturbance", "plant", "force sensor", "sensor", "observer", "guard", "metrics", "end")
"""The order in which parts are called; parts of other names follow in the order of their names."""
_MICROSECONDS_A_STEP = 0.05  # of one slot: decides when a second thread is worth waking
Slots = Flags | NDArray[np.intp] | slice

_NO_INSTANTS = np.empty((0, 4))
_NO_SAMPLES = np.empty((0, 2, 0))
_NO_READINGS = np.empty((0, 6, 0))


@dataclass(frozen=True, slots=True)
class Part:
    """What a component puts into a loop.

    Args:
        rows: what its own rows begin as, settings and state alike, (rows, n); :func:`columns` makes them.
        act: block that is called when a control period begins.
        sample: block that is called at every sampling instant.
        close: block that is called when a control period ends.
        reads: of a sensor, whether its block is called when a run begins, too, for the first reading; else that is the
            true one.
        xhat: of an observer, the estimate that it begins with, (4, n); None for [y, 0, 0].
        alike: numbers that must be the same in all slots that share a call of these blocks.
        period: of an observer, the row of its own that holds the time in s since the sample before; None where it does
            not need it. Whoever has samples that are not evenly spaced sets it before each.
    """

    rows: Array
    act: Block | None = None
    sample: Block | None = None
    close: Block | None = None
    xhat: Array | None = None
    alike: tuple[float, ...] = ()
    reads: bool = False
    period: int | None = None

    @property
    def kind(self) -> tuple[Any, ...]:
        """What two parts must have in common to be one: blocks, number of rows and what is alike."""
        return (
            self.act,
            self.sample,
            self.close,
            len(self.rows),
            self.xhat is None,
            self.alike,
            self.reads,
            self.period,
        )


def columns(n: int, *groups: Any) -> Array:
    """Rows (rows, n) from groups of them: a number is one row, (k,) is k rows alike in all slots, (k, n) is itself."""
    parts = [np.asarray(group, dtype=np.float64) for group in groups]
    shaped = [part if part.ndim == 2 else part.reshape(-1, 1) for part in parts]
    return np.vstack([np.broadcast_to(part, (len(part), n)) for part in shaped])


def side_by_side(parts: Iterable[Part]) -> list[Part]:
    """Parts of neighbouring slots: those of equal kind that follow each other become one."""
    found: list[list[Part]] = []
    for part in parts:
        if found and found[-1][0].kind == part.kind:
            found[-1].append(part)
        else:
            found.append([part])
    return [
        Part(
            np.hstack([part.rows for part in group]),
            group[0].act,
            group[0].sample,
            group[0].close,
            None if group[0].xhat is None else np.hstack([part.xhat for part in group if part.xhat is not None]),
            group[0].alike,
            group[0].reads,
            group[0].period,
        )
        for group in found
    ]


def runs_as_part(it: Any, otherwise: str) -> bool:
    """Whether an object's ``part`` says what it does: its class says ``part`` no earlier than the method ``otherwise``.

    A subclass that overrides the method alone means to do something else than its inherited part.
    """
    order = type(it).__mro__
    places = [next((i for i, kind in enumerate(order) if name in vars(kind)), None) for name in ("part", otherwise)]
    part, method = places
    return part is not None and (method is None or part <= method) and callable(getattr(it, "part", None))


class Loop:
    """n slots in closed loop.

    Attributes:
        rows: all rows, (rows, n): signals, then each part's own.
        n: number of slots.
        substeps: sampling instants in a control period.
        x: states, (4, n); like all that follow a view of the rows.
        y: measurements [h, theta] now, (2, n).
        u: force in N, (n,).
        xhat: estimates, (4, n); those of slots that have ended are held.
        x_d: where the states should be, (4, n).
        alive: 1 in slots that go on, 0 in those that hold still, (n,).
        failed: 1 in slots whose run has failed, (n,).
        reward: of the last control period, (n,).

    Args:
        n: number of slots.
        substeps: sampling instants in a control period.
        parts: by role, see :data:`ROLES`; a sequence in place of a part serves neighbouring slots, each its own.

    Raises:
        ValueError: the parts of a role do not serve n slots in all.
    """

    def __init__(self, n: int, substeps: int, parts: Mapping[str, Part | Sequence[Part]]) -> None:
        self.n, self.substeps = n, substeps
        order = [*(role for role in ROLES if role in parts), *sorted(parts.keys() - {*ROLES})]
        self.parts = {role: [part] if isinstance(part := parts[role], Part) else list(part) for role in order}
        for role, each in self.parts.items():
            if (served := sum(part.rows.shape[1] for part in each)) != n:
                raise ValueError(f"the loop's {role} serves {served} slots, it must serve {n}")
        heights = [max(len(part.rows) for part in each) for each in self.parts.values()]
        edges = np.cumsum([SIGNALS, *heights]).tolist()
        self._own = dict(zip(self.parts, (slice(a, b) for a, b in pairwise(edges)), strict=True))
        self.rows = np.zeros((edges[-1], n))
        self._sections = self._programs()
        self._show()
        self.start(slice(None), np.zeros((4, n)))

    def _programs(self) -> list[tuple[int, int, NDArray[np.int64], int, int]]:
        """Slots that are called alike: first, one behind the last, program, and how it is divided."""
        ends = {role: np.cumsum([part.rows.shape[1] for part in each]) for role, each in self.parts.items()}
        bounds = sorted({0, self.n, *(int(end) for each in ends.values() for end in each)})
        sections = []
        for start, stop in pairwise(bounds):
            place = {role: int(np.searchsorted(each, start, side="right")) for role, each in ends.items()}
            mine = {role: each[place[role]] for role, each in self.parts.items()}
            calls = [
                [
                    (address(block), self._own[role].start, self._own[role].start + len(part.rows))
                    for role, part in mine.items()
                    if (block := getattr(part, when)) is not None
                ]
                for when in ("act", "sample", "close")
            ]
            program = np.array(list(chain(*calls)), dtype=np.int64).reshape(-1, 3)
            sections.append((start, stop, program, len(calls[0]), len(calls[1])))
        return sections

    def _show(self) -> None:
        """Signals by name, as views of the rows."""
        rows = self.rows
        self.x, self.y, self.u = rows[X : X + 4], rows[Y : Y + 2], rows[U]
        self.xhat, self.x_d = rows[XHAT : XHAT + 4], rows[XD : XD + 4]
        self.alive, self.failed, self.reward = rows[ALIVE], rows[FAILED], rows[REWARD]

    def __getstate__(self) -> dict[str, Any]:
        """Without views, which would be copies, and without programs: an address holds in one process alone."""
        return {name: vars(self)[name] for name in ("n", "substeps", "parts", "rows", "_own")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._sections = self._programs()
        self._show()

    def place(self, role: str) -> slice:
        """Where a part's own rows are."""
        return self._own[role]

    def own(self, role: str) -> Array:
        """A part's own rows, (rows, n)."""
        return self.rows[self._own[role]]

    def begin(self, slots: Slots, x: Array) -> None:
        """Put some slots at states ``x`` (4, slots) and read the sensor; other parts stay as they are."""
        rows = self.rows
        rows[X : X + 4, slots] = x
        rows[Y0 : Y0 + 2, slots] = rows[Y : Y + 2, slots] = x[:2]
        rows[U, slots] = rows[FAILED, slots] = rows[REWARD, slots] = 0.0
        rows[XD : XD + 4, slots] = rows[FORCE:SIGNALS, slots] = 0.0
        rows[ALIVE, slots] = 1.0
        if any(part.reads for part in self.parts.get("sensor", ())):
            self._read(slots)

    def _read(self, slots: Slots) -> None:
        """The sensors' first readings: as of one sampling instant at which nothing else happens."""
        begun = np.arange(self.n)[slots]
        own = self._own["sensor"]
        for start, stop, _, _, _ in self._sections:
            mine = begun[(begun >= start) & (begun < stop)]
            part = self.part_of("sensor", start)
            if len(mine) == 0 or not part.reads:
                continue
            rows = np.ascontiguousarray(self.rows[:, mine])
            program: Any = np.array([[address(part.sample), own.start, own.start + len(part.rows)]], dtype=np.int64)
            drive(0, len(mine), rows, program, 0, 1, 0, 1, 1, _NO_INSTANTS, _NO_SAMPLES, _NO_SAMPLES, _NO_READINGS)
            rows[Y0 : Y0 + 2] = rows[Y : Y + 2]
            self.rows[:, mine] = rows

    def part_of(self, role: str, slot: int) -> Part:
        """The part that serves a slot in a role."""
        for part in self.parts[role]:
            slot -= part.rows.shape[1]
            if slot < 0:
                return part
        raise IndexError(f"the loop has {self.n} slots")

    def start(self, slots: Slots, x: Array) -> None:
        """Begin anew in some slots, at states ``x`` (4, slots), with all parts as they were at the beginning."""
        for role in self.parts:
            if role != "observer":  # it begins with what the sensor reads
                self.restart(role, slots)
        self.begin(slots, x)
        if "observer" in self.parts:
            self.restart("observer", slots)

    def restart(self, role: str, slots: Slots) -> None:
        """Bring a part's own rows, and of an observer the estimate, to what they begin as."""
        initial, own = self.initial(role), self.own(role)
        own[:, slots] = initial[:, slots]
        if role == "observer":
            self.xhat[:, slots] = self._xhat()[:, slots]

    def initial(self, role: str) -> Array:
        """What a part's own rows begin as, (rows, n)."""
        each = self.parts[role]
        if len(each) == 1:
            return each[0].rows
        height = max(len(part.rows) for part in each)
        return np.hstack([np.pad(part.rows, ((0, height - len(part.rows)), (0, 0))) for part in each])

    def _xhat(self) -> Array:
        estimates, start = [], 0
        for part in self.parts["observer"]:
            stop = start + part.rows.shape[1]
            at_y = np.vstack([self.y[:, start:stop], np.zeros((2, stop - start))])
            estimates.append(at_y if part.xhat is None else part.xhat)
            start = stop
        return estimates[0] if len(estimates) == 1 else np.hstack(estimates)

    def with_parts(self, **parts: Part | Sequence[Part]) -> Loop:
        """A loop of these slots with more parts: signals and the rows of the parts that were there carry over."""
        loop = Loop(self.n, self.substeps, {**self.parts, **parts})
        loop.rows[:SIGNALS] = self.rows[:SIGNALS]
        for role in self.parts.keys() - parts.keys():
            loop.own(role)[:] = self.own(role)
        return loop

    def run(
        self,
        begin: int = 0,
        periods: int = 1,
        reference: Array = _NO_INSTANTS,
        recording: Array = _NO_SAMPLES,
        positions: Array = _NO_SAMPLES,
        readings: Array = _NO_READINGS,
    ) -> None:
        """Drive whole control periods; arguments as of :func:`smo_gym.kernels.driver.drive`.

        Raises:
            ValueError: an array has another shape: compiled code does not look.
        """
        end, substeps, rows = begin + periods, self.substeps, self.rows
        if positions is not _NO_SAMPLES and positions.shape != (substeps, 2, self.n):
            raise ValueError(f"positions has shape {positions.shape}, it must have shape {(substeps, 2, self.n)}")
        if recording is not _NO_SAMPLES and recording.shape != (substeps, 2, self.n):
            raise ValueError(f"recording has shape {recording.shape}, it must have shape {(substeps, 2, self.n)}")
        if readings is not _NO_READINGS and readings.shape != (substeps, 6, self.n):
            raise ValueError(f"readings has shape {readings.shape}, it must have shape {(substeps, 6, self.n)}")
        if len(reference) and (len(reference) <= end * substeps or reference.shape[1:] != (4,)):
            raise ValueError(f"reference has shape {reference.shape}, it must have {end * substeps + 1} rows of 4")
        for start, stop, program, acts, each in self._sections:
            told: Any = (rows, program, acts, each, begin, end, substeps, reference, recording, positions, readings)
            if stop - start <= LANES:
                drive(start, stop, *told)
            else:
                for_slots(drive, start, stop, _MICROSECONDS_A_STEP * periods * substeps, *told)
