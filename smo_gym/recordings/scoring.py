"""How well velocities are estimated along recordings, against a reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..typing import Array, Flags
from .rig import Recording, Rig

BEFORE, AFTER = 3, 15
"""Samples before and after one of a fault that are not scored either."""
APART = 20
"""Samples between two passages of a fault at least."""
MARGIN = 25
"""Samples that a run has before and behind a passage that counts."""
AROUND = (2, 4)
"""Samples before and after a passage in which its largest error is looked for."""
RESAMPLED, SEED, SHARE = 2000, 1, 0.95


def scored(rig: Rig, recording: Recording) -> Flags:
    """Which samples count: not those of the start, of the smoother's end, and around a fault."""
    first, last = rig.unscored
    found = np.ones(len(recording.t), dtype=np.bool_)
    found[:first] = found[max(len(found) - last, 0) :] = False
    for k in np.flatnonzero(recording.fault):
        found[max(k - BEFORE, 0) : k + AFTER + 1] = False
    return found


def passages(recording: Recording) -> list[slice]:
    """Where the sensor's fault is passed, with the samples around it in which its largest error is looked for."""
    at = np.flatnonzero(recording.fault)
    if len(at) == 0:
        return []
    groups = np.split(at, np.flatnonzero(np.diff(at) > APART) + 1)
    n = len(recording.t)
    return [
        slice(group[0] - AROUND[0], group[-1] + AROUND[1])
        for group in groups
        if group[0] > MARGIN and group[-1] < n - MARGIN
    ]


@dataclass(frozen=True, slots=True)
class Score:
    """One velocity of all runs."""

    rmse: float
    ci_low: float
    ci_high: float
    """The 95 % interval, from resampled runs."""
    lag: float
    """In s, to first order where the cross-correlation is largest."""
    total_variation: float
    """A second."""
    largest: float
    each: Array
    """RMS error of each run, (runs,); NaN where nothing of it is scored."""
    fault_median: float
    fault_largest: float
    """Of the largest errors in the passages of a fault; NaN where there is none."""
    lost: int
    """Runs whose error is not below the rig's bound."""


def score(
    rig: Rig, recordings: Sequence[Recording], estimates: Sequence[Array], reference: Sequence[Array], channel: int
) -> Score:
    """Score one velocity.

    Args:
        rig: of the recordings.
        recordings: all runs.
        estimates: velocities, (samples, 2) for each run.
        reference: the same of what they are compared with.
        channel: 0 or 1.
    """
    squares, counts, errors, slopes, variation, seconds, peaks = [], [], [], [], 0.0, 0.0, []
    for recording, v, truth in zip(recordings, estimates, reference, strict=True):
        mask = scored(rig, recording)
        with np.errstate(over="ignore", invalid="ignore"):
            e = v[:, channel] - truth[:, channel]
            errors.append(e[mask])
            slopes.append(np.gradient(truth[:, channel], recording.t)[mask])
            squares.append(float((e[mask] ** 2).sum()))
            counts.append(int(mask.sum()))
            both = mask[1:] & mask[:-1]
            variation += float(np.abs(np.diff(v[:, channel]))[both].sum())
            seconds += float(np.diff(recording.t)[both].sum())
            if channel == 1:
                peaks += [float(np.abs(e[place]).max()) for place in passages(recording)]
    e, slope, total, n = np.concatenate(errors), np.concatenate(slopes), np.array(squares), np.array(counts)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        each = np.sqrt(np.where(n > 0, total / np.maximum(n, 1), np.nan))
        low, high = _interval(_resampled(total, n))
        return Score(
            rmse=float(np.sqrt(total.sum() / n.sum())),
            ci_low=low,
            ci_high=high,
            lag=float(-(e * slope).sum() / (slope**2).sum()),
            total_variation=variation / seconds,
            largest=float(np.abs(e).max()),
            each=each,
            fault_median=float(np.median(peaks)) if peaks else np.nan,
            fault_largest=float(np.max(peaks)) if peaks else np.nan,
            lost=int((~(each[n > 0] < rig.lost)).sum()),
        )


@dataclass(frozen=True, slots=True)
class Difference:
    """What one observer's error is above another's, run beside run."""

    value: float
    ci_low: float
    ci_high: float
    """The 95 % interval, from runs that are resampled for both alike."""
    better: int
    """Runs in which the first has the smaller error."""
    runs: int


def difference(rig: Rig, recordings: Sequence[Recording], first: Score, second: Score) -> Difference:
    """The difference of two root mean square errors, from scores of one velocity of the same runs."""
    n = np.array([scored(rig, recording).sum() for recording in recordings])
    a, b = (np.where(n > 0, each**2 * n, 0.0) for each in (first.each, second.each))
    low, high = _interval(_resampled(a, n) - _resampled(b, n))
    better = int((first.each < second.each).sum())
    return Difference(first.rmse - second.rmse, low, high, better, int((n > 0).sum()))


def _resampled(squares: Array, counts: Array) -> Array:
    """Root mean square errors of runs drawn with replacement, the same runs whatever the errors."""
    picked = np.random.default_rng(SEED).integers(0, len(counts), (RESAMPLED, len(counts)))
    return np.asarray(np.sqrt(squares[picked].sum(1) / np.maximum(counts[picked].sum(1), 1)))


def _interval(values: Array) -> tuple[float, float]:
    low, high = np.quantile(values, [0.5 - 0.5 * SHARE, 0.5 + 0.5 * SHARE])
    return float(low), float(high)
