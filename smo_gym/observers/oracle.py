"""The true state in place of an estimate: what estimation costs is read off against it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..validation import array
from .protocol import Period

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Oracle:
    """xhat = x from the end of the first control period on.

    Args:
        xhat0: the estimate before the first measurement, shape (4,), as for any other observer.

    Raises:
        ValueError: ``xhat0`` has another shape or is not finite.
    """

    xhat0: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "xhat0", tuple(array("xhat0", self.xhat0, (4,)).tolist()))

    def start(self, n: int, dt: float, force: float) -> "_Truth":
        """An oracle for n slots; any sampling period and force will do."""
        return _Truth(np.array(self.xhat0), n)


class _Truth:
    def __init__(self, xhat0: Array, n: int) -> None:
        self._xhat0 = xhat0[:, None]
        self.xhat = np.repeat(self._xhat0, n, axis=1)

    def reset(self, slots: NDArray[np.bool_]) -> None:
        self.xhat[:, slots] = self._xhat0

    def update(self, period: Period) -> None:
        self.xhat = period.truth.copy()
