"""The article's observer on recordings: runs lost over its gains, beside the theorem's conditions; wrong models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..kernels.rk4 import rk4
from ..models import Model
from ..observers import Gains, SlidingModeObserver
from ..recordings import scoring, smoothing
from ..typing import Array, State
from . import objectives
from .candidates import Candidate, Candidates
from .on_recordings import Runs
from .tuning import tune

M1 = (1.0, 2.0, 4.0, 6.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 16.0, 20.0)
"""Gains of (34) for the second position, rad/s."""
BETA_1 = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
"""Gains of (35) for the second velocity, rad/s^2; its part in |u| is left out."""
STARTS = ("cold", "warm")
"""From [y(0), 0, 0], and from the reference's state."""
MISMATCHES: dict[str, dict[str, float]] = {
    "none": {},
    "motor gain -20 %": {"gain": 0.8},
    "motor gain -50 %": {"gain": 0.5},
    "motor gain +30 %": {"gain": 1.3},
    "1/l +30 %": {"inverse_length": 1.3},
    "1/l -30 %": {"inverse_length": 0.7},
    "motor gain -50 %, 1/l -30 %": {"gain": 0.5, "inverse_length": 0.7},
}
RETUNING = 60
"""Evaluations that every observer gets for each wrong model."""


@dataclass(frozen=True, slots=True)
class Lost:
    """How many runs are lost with a gain."""

    gain: str
    value: float
    start: str
    lost: int
    runs: int
    rmse: float
    """RMS error of the second velocity over the scored samples of all runs."""
    holds: int
    """In how many runs the condition that the theorem asks of this gain holds, evaluated from the recording."""


def lost(runs: Runs, observer: SlidingModeObserver) -> Iterator[Lost]:
    """Rows over m1 and beta_1 of the second position, slope times gain kept, so that inside the layers all is alike."""
    reference = runs.references[smoothing.MODEL]
    speeds = [float(np.abs(v[:, 1]).max()) for v in reference]
    drifts = [float(np.quantile(np.abs(error[:, 1]), 0.99)) for error in drift_errors(runs)]
    gains = Gains.of(observer.gains)
    k_p, k_v = (np.broadcast_to(k, 2).tolist() for k in observer.slopes)
    for name, values, needed in (("m1", M1, speeds), ("beta_1", BETA_1, drifts)):
        for value in values:
            if name == "m1":
                changed = replace(gains, m1=(gains.m1[0], value))
                slopes: Any = ((k_p[0], k_p[1] * gains.m1[1] / value), tuple(k_v))
            else:
                changed = replace(gains, beta_1=(gains.beta_1[0], value), beta_2=(gains.beta_2[0], 0.0))
                slopes = (tuple(k_p), (k_v[0], k_v[1] * gains.beta_1[1] / max(value, 1e-3)))
            varied = replace(observer, gains=changed, slopes=slopes)
            for start in STARTS:
                found = [_from(varied, runs, k, start == "warm") for k in range(len(runs.recordings))]
                score = scoring.score(runs.rig, runs.recordings, found, reference, 1)
                holds = sum(value > each for each in needed)
                yield Lost(name, value, start, score.lost, len(found), score.rmse, holds)


def _from(observer: SlidingModeObserver, runs: Runs, k: int, warm: bool) -> Array:
    recording = runs.recordings[k]
    if warm:
        first = (*recording.y[0].tolist(), *runs.references[smoothing.MODEL][k][0].tolist())
        observer = replace(observer, xhat0=first)
    with np.errstate(over="ignore", invalid="ignore"):
        xhat = observer.run(recording.t, recording.y, recording.u, model=runs.rig.model, force=runs.force)
    return np.asarray(xhat[:, 2:])


def drift_errors(runs: Runs) -> list[Array]:
    """What the model lacks of the accelerations along the reference: means over a sample, each (samples - 1, 2)."""
    found = []
    for recording in runs.recordings:
        x, _, _ = smoothing.smoothed(runs.rig, recording)
        h = np.diff(recording.t)[:, None]
        ahead = np.array(
            [_ahead(runs.rig.model, *each) for each in zip(x[:-1].tolist(), recording.u[:-1], h[:, 0], strict=True)]
        )
        found.append((x[1:, 2:] - ahead[:, 2:]) / h)
    return found


def _ahead(model: Model, x: list[float], u: float, h: float) -> State:
    return rk4(model.rhs, (x[0], x[1], x[2], x[3]), (u, *model.params), h)


@dataclass(frozen=True, slots=True)
class Mistaken:
    """An observer whose model is wrong."""

    mismatch: str
    observer: str
    retuned: bool
    channel: str
    rmse: float
    ci_low: float
    ci_high: float
    lost: int


def mistaken(
    train: Runs,
    test: Runs,
    settings: Candidates,
    names: Sequence[str],
    told: Callable[[int], object] = lambda rows: None,
    kept: Callable[[Candidate, str, Callable[[], Any]], Any] = lambda candidate, mismatch, make: make(),
) -> Iterator[Mistaken]:
    """Rows of observers on wrong models, as they were tuned for the right one, and tuned again for the wrong one.

    Args:
        train: tuned again on these.
        test: scored on these.
        settings: of the observers.
        names: which of them.
        told: called with the number of observers done since the last call.
        kept: gives what was found before for a candidate and mismatch, or makes it.
    """
    for mismatch, factors in MISMATCHES.items():
        model = test.rig.mistaken(**factors)
        wrong = replace(train, rig=replace(train.rig, model=model))
        for name in names:
            candidate = settings[name]
            sets: dict[bool, Mapping[str, Any] | None] = {False: None}
            if candidate.tuned is not None and factors:
                sets[True] = kept(candidate, mismatch, lambda c=candidate, w=wrong: _again(c, w, settings))  # type: ignore[misc]
            for again, tuned in sets.items():
                found = test.velocities(candidate.build(model, tuned), model)
                of = [
                    scoring.score(test.rig, test.recordings, found, test.references[smoothing.MODEL], c) for c in (0, 1)
                ]
                for channel, each in zip(test.rig.channels, of, strict=True):
                    yield Mistaken(mismatch, name, again, channel, each.rmse, each.ci_low, each.ci_high, of[1].lost)
            told(1)


def _again(candidate: Candidate, runs: Runs, settings: Candidates) -> Any:
    assert candidate.tuned is not None
    cost = objectives.on_runs(candidate, runs, settings.scales)
    return tune(cost, candidate.tuned.value, RETUNING, settings.seed).value
