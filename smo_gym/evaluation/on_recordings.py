"""Observers on recordings of a real rig: the rows of real.csv."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..models import Model
from ..recordings import scoring, smoothing
from ..recordings.rig import Recording, Rig
from ..recordings.twins import twin
from ..typing import Array
from .candidates import Candidate

TRUTH = "truth"
"""The reference of twins."""


@dataclass(frozen=True, slots=True)
class Row:
    """A velocity of a rig as an observer estimates it."""

    rig: str
    observer: str
    channel: str
    reference: str
    rmse: float
    """RMS error over the scored samples of all runs, in the channel's unit; its 95 % interval follows."""
    ci_low: float
    ci_high: float
    lag_ms: float
    total_variation: float
    """A second."""
    largest: float
    fault_median: float
    """Of the largest errors in the passages of the sensor's fault; NaN where there is none."""
    fault_largest: float
    lost: int
    """Runs whose RMS error of the second velocity is beyond the rig's bound."""
    runs: int
    ns: float
    """Time for a sample."""
    each: tuple[float, ...] = field(default=(), repr=False)
    """RMS error of each run."""


@dataclass(frozen=True)
class Runs:
    """Recordings and the references for their velocities."""

    rig: Rig
    recordings: Sequence[Recording]
    references: Mapping[str, Sequence[Array]]

    @classmethod
    def of(cls, rig: Rig, recordings: Sequence[Recording]) -> Runs:
        """Recordings with all references."""
        return cls(rig, recordings, smoothing.references(rig, recordings))

    @classmethod
    def twins(cls, rig: Rig, recordings: Sequence[Recording], seed: int) -> Runs:
        """Twins of recordings, whose true velocities are known."""
        seeds = np.random.SeedSequence(seed).generate_state(len(recordings)).tolist()
        made = [twin(rig, recording, own) for recording, own in zip(recordings, seeds, strict=True)]
        return cls(rig, [each for each, _ in made], {TRUTH: [x[:, 2:] for _, x in made]})

    @property
    def force(self) -> float:
        """The largest |u|."""
        return max(float(np.abs(each.u).max()) for each in self.recordings)

    def velocities(self, observer: Any, model: Model | None = None) -> list[Array]:
        """An observer's velocities along each recording, (samples, 2)."""
        known, force = model or self.rig.model, self.force
        with np.errstate(over="ignore", invalid="ignore"):
            return [observer.run(r.t, r.y, r.u, model=known, force=force)[:, 2:] for r in self.recordings]


def rows(
    runs: Runs, observers: Mapping[str, Candidate], told: Callable[[int], object] = lambda observers: None
) -> Iterator[Row]:
    """Rows of all observers, against each reference."""
    for name, candidate in observers.items():
        observer = candidate.build(runs.rig.model)
        runs.velocities(observer)  # compiled
        began = time.perf_counter()
        found = runs.velocities(observer)
        ns = 1e9 * (time.perf_counter() - began) / sum(len(each.t) for each in runs.recordings)
        for reference, truth in runs.references.items():
            of = [scoring.score(runs.rig, runs.recordings, found, truth, channel) for channel in (0, 1)]
            for channel, each in zip(runs.rig.channels, of, strict=True):
                of_model = reference == smoothing.MODEL  # the others know nothing of a fault, and follow it
                yield Row(
                    runs.rig.name,
                    name,
                    channel,
                    reference,
                    each.rmse,
                    each.ci_low,
                    each.ci_high,
                    1e3 * each.lag,
                    each.total_variation,
                    each.largest,
                    each.fault_median if of_model else np.nan,
                    each.fault_largest if of_model else np.nan,
                    of[1].lost,
                    len(runs.recordings),
                    ns,
                    tuple(each.each.tolist()),
                )
        told(1)
