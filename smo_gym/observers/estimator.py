"""Estimators of arrays of measurements, without any environment."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from ..loop import Loop, Part, runs_as_part, side_by_side
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, Flags
from .protocol import Compiled, Estimator, Observer
from .recorded import run


class Compiling:
    """Gives an observer that has a ``part`` the estimator that runs it."""

    __slots__ = ()

    def start(self: Compiled, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> BlockEstimator:
        """An estimator of n slots; arguments and errors as of :meth:`~smo_gym.observers.protocol.Observer.start`."""
        return BlockEstimator([self.part(n, dt, force, nominal)], n)

    def run(
        self: Compiled,
        t: ArrayLike,
        y: ArrayLike,
        u: ArrayLike,
        model: Model | CartPendulum | None = None,
        force: float | None = None,
    ) -> Array:
        """Estimates along a recording, (samples, 4): :func:`~smo_gym.observers.recorded.run`."""
        return run(self, t, y, u, model, force)


class BlockEstimator:
    """An observer's block at work on measurements that are handed in."""

    def __init__(self, parts: Sequence[Part], n: int) -> None:
        self._n, self._parts, self._uneven = n, parts, False
        self._loop = Loop(n, 1, {"observer": parts})
        self._loop.start(slice(None), np.zeros((4, n)))

    @property
    def xhat(self) -> Array:
        """The estimates (4, n), a copy."""
        return self._loop.xhat.copy()

    def reset(self, slots: Flags, y: Array) -> None:
        """Start the marked slots anew."""
        x = np.concatenate([y, np.zeros_like(y)])
        self._loop.start(slots, x[:, slots])

    def update(self, samples: Array, u: Array, elapsed: float | None = None) -> None:
        """Bring the estimates to the end of a control period.

        Samples are evenly spaced as :meth:`~smo_gym.observers.protocol.Observer.start` was told, or ``elapsed`` seconds
        apart.
        """
        if elapsed is not None or self._uneven:
            self._space(elapsed)
        self._loop.substeps = len(samples)
        self._loop.u[:] = u
        self._loop.run(recording=np.ascontiguousarray(samples))

    def _space(self, elapsed: float | None) -> None:
        """Tell the blocks the time since the sample before; None for what they began with."""
        self._uneven = elapsed is not None
        own, start = self._loop.own("observer"), 0
        for part in self._parts:
            stop = start + part.rows.shape[1]
            if part.period is not None:
                own[part.period, start:stop] = part.rows[part.period] if elapsed is None else elapsed
            start = stop


class Several:
    """Estimators of neighbouring slots as one."""

    def __init__(self, each: Sequence[tuple[slice, Estimator]]) -> None:
        self._each = each

    @property
    def xhat(self) -> Array:
        """The estimates (4, n), a copy."""
        return np.hstack([estimator.xhat for _, estimator in self._each])

    def reset(self, slots: Flags, y: Array) -> None:
        """Start the marked slots anew."""
        for mine, estimator in self._each:
            estimator.reset(slots[mine], y[:, mine])

    def update(self, samples: Array, u: Array) -> None:
        """Bring the estimates to the end of a control period."""
        for mine, estimator in self._each:
            estimator.update(np.ascontiguousarray(samples[:, :, mine]), u[mine])

    def see(self, slots: Flags, x: Array) -> None:
        """Show the states to those that see them."""
        for mine, estimator in self._each:
            if (see := getattr(estimator, "see", None)) is not None:
                see(slots[mine], x[:, mine])


def _runs(observers: Sequence[Observer]) -> list[tuple[Observer, int]]:
    """Neighbouring slots that have the very same observer, as that and their number."""
    runs = [list(run) for _, run in groupby(observers, id)]
    return [(run[0], len(run)) for run in runs]


def parts_of(
    observers: Sequence[Observer], dt: float, force: float, nominal: Model | CartPendulum
) -> list[Part] | None:
    """What observers, one a slot, put into a loop, equal kinds as one; None where one of them is not compiled.

    Raises:
        ValueError: an observer cannot work with these.
    """
    runs = _runs(observers)
    if not all(runs_as_part(observer, "start") for observer, _ in runs):
        return None
    return side_by_side(cast(Compiled, observer).part(n, dt, force, nominal) for observer, n in runs)


def start_each(observers: Sequence[Observer], dt: float, force: float, nominal: Model | CartPendulum) -> Estimator:
    """An estimator whose slot i is ``observers[i]``'s, of any kinds.

    Raises:
        ValueError: an observer cannot work with these.
    """
    if all(isinstance(observer, Compiling) for observer in observers):  # others have estimators of their own
        parts = parts_of(observers, dt, force, nominal)
        if parts is not None:
            return BlockEstimator(parts, len(observers))
    each: list[tuple[slice, Estimator]] = []
    start = 0
    for observer, n in _runs(observers):
        each.append((slice(start, start + n), observer.start(n, dt, force, nominal)))
        start += n
    return Several(each)
