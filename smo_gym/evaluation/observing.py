"""Observers on simulated encoders: on the same trajectories, and each in the closed loop of one law."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from ..loop import Loop
from ..typing import Array
from . import scenario, velocity_errors
from .candidates import Candidate
from .open_loop import Trajectories, trajectories
from .scenario import Scenario
from .store import Store, digest
from .study import Group, Outcome

EXACT, NOISE = "exact", "noise"
"""The sensors that noise gains are measured with."""
SENSORS: dict[str, Any] = {
    EXACT: {},
    "counts": "encoders",
    NOISE: {"noise": (2e-4, 1e-3)},
    "delay": {"resolution": (1e-4, 2.0 * np.pi / 4096), "delay": (5, 5)},
    "cart-pole": "cart-pole",
    "qube": "qube",
}
"""The sensors of the table: presets, and some that are chosen."""
LEVELS = (0.05, 0.1, 0.2)
LAW = "lqr"
HORIZON, FORCE, PERIOD = 10.0, 30.0, 0.001
"""Length of a run in s, bound of the force in N, sampling and control period in s: chosen."""
VELOCITIES = ("h_dot", "theta_dot")
MEANS = ("mse_h", "mse_theta", "effort", "total_variation")
"""Metrics of the closed loop whose means are told."""
LOST = 1e4
"""An estimate beyond this is lost, as in :mod:`.guard`."""
SIZE = 64
"""Slots whose time is measured."""


@dataclass(frozen=True, slots=True)
class Row:
    """An observer behind a sensor at a level of uncertainty, of one velocity."""

    sensor: str
    uncertainty: float
    loop: str
    """Which: open or closed."""
    observer: str
    channel: str
    runs: int
    failed: int
    rmse: float
    """Root of the mean square over all runs that did not fail; its 95 % interval, bootstrapped over runs, follows."""
    ci_low: float
    ci_high: float
    largest: float = np.nan
    lag_ms: float = np.nan
    """Median over runs, like the next two."""
    total_variation: float = np.nan
    convergence: float = np.nan
    noise_gain: float = np.nan
    """RMS of what noise adds to the estimate, by the noise's own standard deviation, in 1/s."""
    mse_h: float = np.nan
    """Of the closed loop: mean squares of the positions, effort and total variation of the force, means over runs."""
    mse_theta: float = np.nan
    effort: float = np.nan
    force_variation: float = np.nan


def place(sensor: str, levels: Sequence[float] = LEVELS) -> Scenario:
    """The scenario of the table behind a sensor: Table 4's start, with a bound of the force."""
    told = scenario.named("regulation").changed(horizon=HORIZON, force_limit=FORCE, uncertainty=list(levels))
    return told.with_options(sensor, sensor=SENSORS[sensor]) if SENSORS[sensor] else told


def simulated(sensor: str, level: float, runs: int, seed: int) -> Trajectories:
    """What a sensor reads of plants that the law controls on their true state."""
    here = place(sensor)
    return trajectories(
        here.environment,
        here.agent(LAW),
        np.array(here.initial_states.value[""]),
        level,
        runs,
        seed,
        **{**here.environment_options, "control_period": PERIOD},
    )


def open_loop(
    observers: dict[str, Candidate],
    sensors: Sequence[str],
    levels: Sequence[float],
    runs: int,
    seed: int,
    store: Store | None = None,
    told: Callable[[int], object] = lambda estimates: None,
) -> Iterator[Row]:
    """Rows of all observers on the same trajectories, one sensor and level after the other.

    Args:
        observers: by name.
        sensors: of :data:`SENSORS`.
        levels: of uncertainty.
        runs: plants a level.
        seed: of plants and noise.
        store: keeps what is done.
        told: called with the number of observers done since the last call.
    """
    for level in levels:
        exact: Trajectories | None = None
        for sensor in sensors:
            seen: Trajectories | None = None
            for name, candidate in observers.items():
                key = digest(["open loop", candidate.model_dump(mode="json"), sensor, level, runs, seed])
                kept = store.read(key) if store else None
                if kept is None:
                    seen = seen or simulated(sensor, level, runs, seed)
                    if sensor == EXACT:
                        exact = seen
                    if sensor == NOISE:
                        exact = exact or simulated(EXACT, level, runs, seed)
                    kept = _measured(candidate, seen, exact if sensor == NOISE else None)
                    if store:
                        store.write(key, kept)
                told(1)
                yield from _rows(sensor, level, name, kept)


def _measured(candidate: Candidate, seen: Trajectories, exact: Trajectories | None) -> dict[str, Array]:
    observer = candidate.build()
    with np.errstate(over="ignore", invalid="ignore"):
        xhat = seen.estimated(observer)
        found = velocity_errors.errors(xhat, seen.x, seen.dt)
        arrays = {name: np.asarray(getattr(found, name)) for name in velocity_errors.FIELDS}
        arrays["failed"] = ~(np.abs(xhat).max((0, 1)) < LOST)
        if exact is not None:
            late = slice(round(velocity_errors.SETTLED / seen.dt), None)
            added = (xhat - exact.estimated(observer))[late, 2:]
            arrays["noise_gain"] = np.sqrt((added**2).mean(0)) / np.array(SENSORS[NOISE]["noise"])[:, None]
    return arrays


def _rows(sensor: str, level: float, name: str, kept: dict[str, Array]) -> Iterator[Row]:
    failed = kept["failed"].astype(np.bool_)
    for c, channel in enumerate(VELOCITIES):
        of = {field: values[c, ~failed] for field, values in kept.items() if field != "failed"}
        yield Row(
            *(sensor, level, "open", name, channel, len(failed), int(failed.sum())),
            *pooled(of["rmse"]),
            float(of["largest"].max()) if len(of["largest"]) else np.nan,
            1e3 * _median(of["lag"]),
            _median(of["total_variation"]),
            _median(of["convergence"]),
            _median(of["noise_gain"]) if "noise_gain" in of else np.nan,
        )


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else np.nan


def pooled(rmse: Array) -> tuple[float, float, float]:
    """Root of the mean square of runs' RMS errors, with its interval: percentiles of 2000 resamplings of the runs."""
    if len(rmse) == 0:
        return np.nan, np.nan, np.nan
    value = float(np.sqrt((rmse**2).mean()))
    if len(rmse) == 1 or np.ptp(rmse) == 0.0:
        return value, value, value
    sure = stats.bootstrap((rmse**2,), np.mean, n_resamples=2000, rng=0, method="percentile").confidence_interval
    return value, float(np.sqrt(sure.low)), float(np.sqrt(sure.high))


def wanted(names: Sequence[str], sensors: Sequence[str], levels: Sequence[float], runs: int) -> list[Group]:
    """The groups of the closed loop."""
    places = {sensor: place(sensor, levels) for sensor in sensors}
    return [
        Group(places[sensor], LAW, level, "", name, runs) for sensor in sensors for level in levels for name in names
    ]


def closed(sensor: str, outcome: Outcome) -> Iterator[Row]:
    """Rows of a group of the closed loop."""
    group, stood = outcome.group, ~outcome.failed
    of = {name: values[stood] for name, values in outcome.metrics.items()}
    told = [
        float(of[name].mean()) if stood.any() else np.nan
        for name in ("mse_h", "mse_theta", "effort", "total_variation")
    ]
    for channel in VELOCITIES:
        yield Row(
            *(sensor, group.uncertainty, "closed", group.arm, channel, group.runs, int(outcome.failed.sum())),
            *pooled(of[f"late_rms_{channel}"]),
            *(np.nan,) * 5,
            *told,
        )


def nanoseconds(candidate: Candidate, repetitions: int = 5) -> float:
    """Time in ns that an observer takes for a slot and sample, on one thread: the least of some."""
    here = place(EXACT)
    task = here.task
    part = candidate.build().part(SIZE, PERIOD, FORCE, task.params)
    loop, alone = Loop(SIZE, 1, {"observer": part}), Loop(SIZE, 1, {})
    periods = 2000
    best = []
    for each in (loop, alone):
        each.run(periods=10)
        times = []
        for _ in range(repetitions):
            began = time.perf_counter()
            each.run(periods=periods)
            times.append(time.perf_counter() - began)
        best.append(min(times))
    return 1e9 * max(best[0] - best[1], 0.0) / (periods * SIZE)
