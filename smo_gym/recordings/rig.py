"""What a real rig is known by, and what was recorded of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from ..models import Model
from ..typing import Array, Flags


@dataclass(frozen=True, slots=True)
class Recording:
    """One run."""

    name: str
    t: Array
    """Times of the samples in s, (samples,); gaps stay."""
    y: Array
    """Positions, (samples, 2), the second an angle without jumps of a turn."""
    u: Array
    """Input from each sample to the next, in the model's unit, (samples,)."""
    fault: Flags
    """Samples at which the sensor of the second position says nothing, (samples,)."""

    def between(self, first: float, last: float) -> Recording:
        """The samples from one time on to before another, in s."""
        kept = (self.t >= first) & (self.t < last)
        return Recording(self.name, self.t[kept], self.y[kept], self.u[kept], self.fault[kept])


@dataclass(frozen=True, slots=True)
class Rig:
    """A rig: its model, its sensors, and how its recordings are read and scored."""

    name: str
    channels: tuple[str, str]
    """Names of both velocities in tables."""
    units: tuple[str, str]
    model: Model
    period: float
    """Sampling period in s."""
    numbers: tuple[str, ...]
    """Names of the model's numbers, as its equations have them."""
    quanta: tuple[float, float]
    """Steps of the measured positions."""
    noise: tuple[float, float]
    """Standard deviations of the positions, quantisation included."""
    acceleration: tuple[float, float]
    """Process noise: accelerations per root Hz, the first along the input."""
    columns: tuple[str, str, str, str]
    """Columns of time, both positions and the input."""
    corrected: Callable[[Array], tuple[Array, Flags]]
    """The second position, and where it says nothing, from its unwrapped readings."""
    delay: float
    """Of the input, in samples."""
    unscored: tuple[int, int]
    """Samples at both ends of a run that are not scored: an estimator's start, a smoother's end."""
    lost: float
    """RMS error of the second velocity beyond which a run is lost."""
    window: tuple[int, int]
    """Samples and degree of the Savitzky-Golay reference."""
    jerk: tuple[float, float]
    """Jerks per root Hz that the model-free smoother grants."""
    parts: Mapping[str, tuple[int, ...]]
    """Which of the model's numbers grow with the motor's gain and with the inverse of the pendulum's length."""
    held: tuple[str, ...] = ()
    """What is not fitted, as :func:`.fitting.fit` names it, because recordings do not tell it."""

    def of(self, params: Sequence[float]) -> Rig:
        """The rig with other numbers of its model."""
        return replace(self, model=replace(self.model, params=tuple(params)))

    def mistaken(self, **factors: float) -> Model:
        """The model with a motor gain, or an inverse length, that is wrong by some factors."""
        numbers = list(self.model.params)
        for part, factor in factors.items():
            for index in self.parts[part]:
                numbers[index] *= factor
        return self.of(numbers).model
