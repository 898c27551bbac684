"""The article's scheme with real encoders, and under a push that its model has not."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats

from ..kernels.blocks import ALIVE, XHAT, X, at, block, four, put
from ..typing import Array
from . import metrics
from .arms import ARMS
from .metrics import Meter, Metric, add
from .scenario import Scenario
from .study import Group, Outcome, groups, measure

Measure = Callable[..., list[Outcome]]
SENSORS: dict[str, dict[str, tuple[float, float]]] = {
    "exact": {},
    "encoders": {"resolution": (1e-4, 2.0 * math.pi / 4096)},
    "1 mrad": {"noise": (2e-4, 1e-3)},
    "5 mrad": {"noise": (1e-3, 5e-3)},
}
"""Sensors of the table, by what they are called there, all chosen."""
MEANT = "(encoders: 0.1 mm, 4096 counts a turn; 1 mrad: noise of 0.2 mm, 1 mrad; 5 mrad: 1 mm, 5 mrad)"
UNCERTAINTY = 0.2
SETTLED = 2000
"""Control periods before the errors of a velocity count: 2 s at the article's 1 ms."""
FEW = 50
"""Plants, the first ones, that bound the search for the largest push from above."""
NEAR = 0.95
"""Of the least push under which some of the few fall: all are tried there next."""
COLUMNS = ("late_rms_h_dot", "late_rms_theta_dot", "mse_h", "mse_theta", "effort", "total_variation", "peak_force")
"""Metrics of the table."""
_PERIODS, _ERRORS = 0, 1


@block
def _late(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going = at(signals, ALIVE, i) > 0.0
        x, xhat = four(signals, X, i), four(signals, XHAT, i)
        late = going and at(own, _PERIODS, i) >= SETTLED
        add(own, _ERRORS, i, (xhat[2] - x[2]) * (xhat[2] - x[2]), late)
        add(own, _ERRORS + 1, i, (xhat[3] - x[3]) * (xhat[3] - x[3]), late)
        put(own, _PERIODS, i, at(own, _PERIODS, i) + (1.0 if going else 0.0))


def _finish(rows: Array, control_period: float) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.sqrt(rows[_ERRORS : _ERRORS + 2] / np.maximum(rows[_PERIODS] - SETTLED, 0.0)))


LATE = Meter(
    "late errors",
    (
        Metric("late_rms_h_dot", "m/s", "RMS of the estimate of h' less h' after 2000 control periods"),
        Metric("late_rms_theta_dot", "rad/s", "the same of theta'"),
    ),
    3,
    _finish,
    close=_late,
)


def late_errors() -> AbstractContextManager[None]:
    """While it lasts, runs also measure the errors of the velocities once they have settled."""
    return metrics.measuring([LATE])


@dataclass(frozen=True, slots=True)
class Row:
    """A controller on an observer's estimate behind a sensor: means over runs, and their 95 % intervals."""

    sensor: str
    controller: str
    arm: str
    runs: int
    failed: int
    means: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]


def of_sensors(place: Scenario, controllers: Sequence[str], runs: int) -> dict[str, list[Group]]:
    """The groups of the table, by sensor: every arm, at 20 %."""
    found = {}
    for name, settings in SENSORS.items():
        behind = place.with_options(name, sensor=settings) if settings else place
        all_of_it = groups([behind], controllers, list(ARMS), runs)
        found[name] = [group for group in all_of_it if group.uncertainty == UNCERTAINTY]
    return found


def row(sensor: str, outcome: Outcome) -> Row:
    """What runs come to: over those that did not fail, with bootstrapped intervals of their means."""
    group, stood = outcome.group, ~outcome.failed
    means, low, high = {}, {}, {}
    for name in COLUMNS:
        values = outcome.metrics[name][stood]
        means[name] = float(values.mean()) if len(values) else math.nan
        low[name] = high[name] = means[name]
        if len(values) > 1 and np.ptp(values) > 0.0:
            sure = stats.bootstrap((values,), np.mean, n_resamples=2000, rng=0, method="percentile")
            low[name], high[name] = map(float, sure.confidence_interval)
    return Row(sensor, group.controller, group.arm, group.runs, int(outcome.failed.sum()), means, low, high)


@dataclass(frozen=True, slots=True)
class Push:
    """The largest constant push that all plants stand on an arm's estimate.

    Args:
        case: the name of the initial state.
        arm: its name.
        stood: the largest push tried in N under which none fell; NaN where some fall without any.
        fell: the least push tried in N under which some fell.
        falls: how many fell under it.
        runs: of how many.
    """

    case: str
    arm: str
    stood: float
    fell: float
    falls: int
    runs: int

    @property
    def at_most(self) -> float:
        """The 95 % bound (Clopper and Pearson) of the share of plants that fall under ``stood``, of which none did."""
        return float(stats.beta.ppf(0.95, 1, self.runs)) if math.isfinite(self.stood) else math.nan

    @property
    def surviving(self) -> tuple[float, float]:
        """The 95 % interval (Clopper and Pearson) of the share of plants that stand ``fell``."""
        sure = stats.binomtest(self.runs - self.falls, self.runs).proportion_ci(0.95, "exact")
        return float(sure.low), float(sure.high)


def largest_pushes(
    place: Scenario,
    case: str,
    runs: int,
    seed: int,
    precision: float = 0.1,
    measured: Measure = measure,
    told: Callable[[int], Any] = lambda rounds: None,
) -> list[Push]:
    """Bisect the largest constant force on the cart that no plant falls under, for every arm on the same plants.

    A plant that stands a push is taken to stand smaller ones. The first plants alone bound the search from above, as
    one that falls among few falls among all.

    Args:
        place: the upright scenario, of a single controller.
        case: the name of its initial state.
        runs: random plants, at 20 %.
        seed: of the plants.
        precision: in N.
        measured: as :func:`smo_gym.evaluation.study.measure`.
        told: called after each round.
    """
    place = place.model_copy(
        update={
            "initial_states": _valued(place.initial_states, {case: place.initial_states.value[case]}),
            "uncertainty": _valued(place.uncertainty, (UNCERTAINTY,)),
        }
    )
    (controller,) = place.controllers

    def tried(pushes: dict[str, float], plants: int) -> dict[str, int]:
        """How many fall under a push each."""
        wanted = []
        for name, newtons in pushes.items():
            pushed = place.with_options(disturbance={"kind": "constant", "force": newtons}) if newtons else place
            wanted += [group for group in groups([pushed], [controller], [name], plants) if group.uncertainty > 0.0]
        falls = {outcome.group.arm: int(outcome.failed.sum()) for outcome in measured(wanted, seed)}
        told(1)
        return falls

    def search(found: dict[str, Push], plants: int) -> None:
        while trying := {name: _next(push) for name, push in found.items() if _open(push, precision)}:
            for name, falls in tried(trying, plants).items():
                found[name] = _narrowed(found[name], trying[name], falls, plants)

    bare = tried(dict.fromkeys(ARMS, 0.0), runs)
    found = {name: Push(case, name, 0.0, math.inf, 0, runs) for name, falls in bare.items() if not falls}
    hopeless = {name: Push(case, name, math.nan, 0.0, falls, runs) for name, falls in bare.items() if falls}
    search(found, min(FEW, runs))
    if found and runs > FEW:
        near = {name: NEAR * push.fell for name, push in found.items()}
        for name, falls in tried(near, runs).items():  # what few stand, all need not
            found[name] = _narrowed(replace(found[name], stood=0.0), near[name], falls, runs)
        search(found, runs)
        if of_few := {name: push.fell for name, push in found.items() if push.runs < runs}:
            for name, falls in tried(of_few, runs).items():
                found[name] = replace(found[name], falls=falls, runs=runs)
    return [(hopeless | found)[name] for name in ARMS]


def _open(push: Push, precision: float) -> bool:
    return push.fell - push.stood > precision


def _narrowed(push: Push, newtons: float, falls: int, plants: int) -> Push:
    return replace(push, fell=newtons, falls=falls, runs=plants) if falls else replace(push, stood=newtons)


def _next(push: Push) -> float:
    """What to try: twice as much until some fall, then the middle."""
    if math.isinf(push.fell):
        return max(2.0 * push.stood, 1.0)
    return 0.5 * (push.stood + push.fell)


def _valued(setting: Any, value: Any) -> Any:
    """A setting with another value."""
    return setting.model_copy(update={"value": value})
