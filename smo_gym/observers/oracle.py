"""The true state in place of an estimate: what estimation costs is read off against it."""

from dataclasses import dataclass

import numpy as np

from ..kernels.blocks import XHAT, X, block, four, put_four
from ..loop import Part
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, Flags


@block
def _look(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        put_four(signals, XHAT, i, four(signals, X, i))


@dataclass(frozen=True, slots=True)
class Oracle:
    """xhat = x at every control instant."""

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What an oracle puts into a loop that has a plant; any sampling period, force and plant will do."""
        return Part(np.empty((0, n)), sample=_look)

    def start(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> "_Truth":
        """An oracle for n slots, which must be shown the states."""
        return _Truth(n)


class _Truth:
    def __init__(self, n: int) -> None:
        self._x = np.zeros((4, n))

    @property
    def xhat(self) -> Array:
        return self._x.copy()

    def reset(self, slots: Flags, y: Array) -> None:
        self._x[:, slots] = np.concatenate([y, np.zeros_like(y)])[:, slots]

    def update(self, samples: Array, u: Array) -> None:
        self._x[:2] = samples[-1]

    def see(self, slots: Flags, x: Array) -> None:
        self._x[:, slots] = x[:, slots]
