"""The true state in place of an estimate: what estimation costs is read off against it."""

from dataclasses import dataclass

import numpy as np

from ..plant import CartPendulum
from ..typing import Array, Flags
from .protocol import Period


@dataclass(frozen=True, slots=True)
class Oracle:
    """xhat = x at every control instant."""

    def start(self, n: int, dt: float, force: float, nominal: CartPendulum) -> "_Truth":
        """An oracle for n slots; any sampling period, force and plant will do."""
        return _Truth(n)


class _Truth:
    def __init__(self, n: int) -> None:
        self._x = np.zeros((4, n))

    @property
    def xhat(self) -> Array:
        return self._x.copy()

    def reset(self, slots: Flags, truth: Array) -> None:
        self._x[:, slots] = truth[:, slots]

    def update(self, period: Period) -> None:
        self._x = period.truth.copy()
