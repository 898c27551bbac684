"""Where laws are compared: a start, a sensor, an observer and what pushes besides; and what a run on it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from .. import files
from ..envs.task import Task
from ..kernels.blocks import ALIVE, XD, U, X, at, block, offsets, put
from ..observers import ExtendedKalmanFilter, Observer, Oracle, SlidingModeObserver, SteadyKalman
from ..plant import CartPendulum
from ..typing import Array
from ..wrappers import VectorObserverWrapper
from . import configs, metrics, scenario
from .draws import deviations, noise
from .metrics import Meter, Metric, add
from .rollout import rollout

REGULATION, UPRIGHT, TRACKING, LEARNING = "regulation", "upright", "tracking", "learning"
LIMIT = 30.0
"""Of the force in N: chosen, as in the observers' table."""
LEVEL = 0.2
"""Of uncertainty: the article's largest."""
SENSORS: dict[str, Any] = {
    "exact": {},
    "counts": "encoders",
    "noise": {"noise": (2e-4, 1e-3)},
    "cart-pole": "cart-pole",
}
"""A preset of counts; noise of 0.2 mm and 1 mrad, chosen; and a rig's, measured there."""
PERIODS = (0.001, 0.02)
"""Control periods in s; sensors and observers are at 1 ms in both."""
DISTURBANCE = (
    {"kind": "sine", "force": 3.0, "frequency": 0.5, "phase": (-np.pi, np.pi)},
    {"kind": "step", "force": 2.0, "start": 5.0},
)
"""On the cart, in N: matched. Chosen, like the friction."""
FRICTION = {"cart_coulomb": 1.0, "cart_viscous": 1.0, "pivot_viscous": 0.05 * 0.32 * 0.44**2}
"""The pivot's is 0.05 1/s of the nominal rod."""
OUTSIDE = {"level": 0.35, "disturbance": ({"kind": "sine", "force": 4.0, "frequency": 1.0, "phase": (-np.pi, np.pi)},)}
"""What no law was tuned on: plants further from the nominal one, and another disturbance."""
_LATE = 5.0
"""The last seconds of a run, whose total variation shows chatter at rest."""


@dataclass(frozen=True, slots=True)
class Case:
    """A start and a task.

    Args:
        name: in tables.
        environment: its id.
        low: of the initial state, drawn uniformly for each run, (4,).
        high: of it.
        horizon: in s.
        family: which gains a law has here.
        options: further ones of the environment.
    """

    name: str
    environment: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    horizon: float
    family: str
    options: tuple[tuple[str, Any], ...] = ()


@cache
def cases() -> dict[str, Case]:
    """By name: Table 4's start, Table 5's first, the truly inverted plant, Table 7's reference, and PPO's box."""
    four, five, upright, seven = map(scenario.named, ("regulation", "initial-conditions", "upright", "tracking"))
    hanging = (("angle_limit", np.pi), ("track_limit", 50.0))
    start, first, on_it = four.initial_states.value[""], five.initial_states.value["1"], seven.initial_states.value[""]
    lean = (0.0, 0.3, 0.0, 0.0)
    box = files.read_yaml(configs.path("ppo"))["SMOPendulum-v0"]["env_kwargs"]
    low, high = map(tuple, box["initial_state"])
    found = (
        Case("table-4", four.environment, start, start, four.horizon.value, REGULATION, hanging),
        Case("table-5-1", five.environment, first, first, five.horizon.value, REGULATION, hanging),
        Case(
            *("upright", upright.environment, tuple(-x for x in lean), lean, 20.0, UPRIGHT),
            (("track_limit", 50.0),),
        ),
        Case(
            *("tracking", seven.environment, on_it, on_it, seven.horizon.value, TRACKING),
            (*hanging, ("reference", seven.trajectory()), ("preview", 0)),
        ),
        Case("learning", four.environment, low, high, box["horizon"], LEARNING, hanging),
    )
    return {case.name: case for case in found}


ACCELERATION = (0.0135, 0.093)
"""Of the Kalman filters, m/s^2 and rad/s^2 by the root of Hz: tuned in open loop, without any disturbance."""
ZERO, MEASURED = "zero", "measured"


@dataclass(frozen=True, slots=True)
class Estimate:
    """An observer of the comparison, as it starts."""

    observer: str
    start: str

    @property
    def family(self) -> str:
        """Which gains a law has on it: tuned on the article's observer as printed, or on a filter."""
        return "printed" if self.observer == "printed" else "filtered"

    def build(self) -> Observer:
        """The observer."""
        measured: Any = {"xhat0": MEASURED} if self.start == MEASURED else {}
        noisy: Any = {"noise": SENSORS["noise"]["noise"]}
        if self.observer == "printed":
            return SlidingModeObserver(gains="smc", slopes=(12.5, 12.5), **measured)
        if self.observer in ("smo", "smo-uncompensated"):
            return SlidingModeObserver(
                gains="lqr", slopes=(12.5, 12.5), compensation=self.observer == "smo", **measured
            )
        if self.observer == "constant":
            gains = {"m1": (2.0, 2.0), "beta_1": (3.0, 10.0), "beta_2": (0.0, 0.0)}
            return SlidingModeObserver(gains=gains, slopes=(12.5, 12.5), **measured)
        if self.observer == "ekf":
            return ExtendedKalmanFilter(**noisy, acceleration=ACCELERATION)
        if self.observer == "steady-kalman":
            return SteadyKalman(**noisy, acceleration=ACCELERATION)
        return Oracle()


ESTIMATES = (
    Estimate("printed", ZERO),
    Estimate("printed", MEASURED),
    Estimate("constant", MEASURED),
    Estimate("ekf", MEASURED),
    Estimate("true", MEASURED),
)
"""The article's observer with Table 3's column of SMC and compensation; the same with constant gains (3, 10) and none;
the extended Kalman filter as it was tuned for the observers' table; the true state."""


@dataclass(frozen=True, slots=True)
class Place:
    """Everything about a cell of the table but the law."""

    case: str
    estimate: Estimate
    sensor: str
    period: float
    """Control period in s."""
    disturbed: bool = False
    outside: bool = False
    """Plants and disturbance that no law was tuned on."""

    @property
    def family(self) -> str:
        """Which of a law's gains are meant for it, case and estimate; upright those of the filter serve all."""
        family = cases()[self.case].family
        if family == LEARNING:
            return f"{family}-{self.estimate.observer}"
        return f"{family}-{'filtered' if family == UPRIGHT else self.estimate.family}"

    def options(self) -> dict[str, Any]:
        """Of the environment."""
        case = cases()[self.case]
        pushed: dict[str, Any] = {}
        if self.disturbed:
            pushed = {"disturbance": OUTSIDE["disturbance"] if self.outside else DISTURBANCE, "friction": FRICTION}
        return {
            **dict(case.options),
            **pushed,
            "horizon": case.horizon,
            "control_period": self.period,
            "force_limit": LIMIT,
            "sensor": SENSORS[self.sensor],
        }


Law = Callable[[float, CartPendulum], Any]
"""A law for a control period and a nominal plant."""


def run(place: Place, law: Law, runs: int, seed: int) -> dict[str, Array]:
    """A law on random plants from random starts: metrics of each run by name, and ``failed``, 1 or 0, each (runs,).

    Args:
        place: where.
        law: makes it.
        runs: plants.
        seed: of plants, starts and noise.
    """
    case = cases()[place.case]
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        case.environment, runs, autoreset_mode=AutoresetMode.DISABLED, **place.options()
    )
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    level = OUTSIDE["level"] if place.outside else LEVEL
    plants = [task.params.perturbed(level * draw).as_array() for draw in deviations(seed, runs)]
    starts = [np.random.default_rng([seed, each, 2]).uniform(case.low, case.high) for each in range(runs)]
    reset = {"state": np.array(starts), "params": np.array(plants)}
    noises = {"noise": np.array(noise(seed, runs))} if task.random else {}
    with metrics.measuring([meter(case.horizon, place.period)]), np.errstate(over="ignore", invalid="ignore"):
        observed = VectorObserverWrapper(env, place.estimate.build())
        found = rollout(observed, law(place.period, task.params), options={**reset, **noises})
    return {**found.metrics, "failed": found.failed.astype(np.float64)}


_ABSOLUTE, _SAMPLES, _DONE, _BEFORE, _VARIATION, _START, _ = offsets(2, 1, 1, 1, 1, 1)


@block
def _sample(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going = at(signals, ALIVE, i) > 0.0
        add(own, _ABSOLUTE, i, abs(at(signals, X, i) - at(signals, XD, i)), going)
        add(own, _ABSOLUTE + 1, i, abs(at(signals, X + 1, i) - at(signals, XD + 1, i)), going)
        add(own, _SAMPLES, i, 1.0, going)


@block
def _close(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going, u, k = at(signals, ALIVE, i) > 0.0, at(signals, U, i), at(own, _DONE, i)
        add(own, _VARIATION, i, abs(u - at(own, _BEFORE, i)), going and k >= at(own, _START, i))
        put(own, _BEFORE, i, u if going else at(own, _BEFORE, i))
        add(own, _DONE, i, 1.0, going)


def _finish(rows: Array, control_period: float) -> Array:
    lasted = rows[_DONE] * control_period
    return np.array([*(rows[_ABSOLUTE:_SAMPLES] / rows[_SAMPLES] * lasted), rows[_VARIATION]])


def meter(horizon: float, period: float) -> Meter:
    """What the laws' table has besides the usual, of runs of a length: IAE, and what the force does in the end."""
    return Meter(
        "laws",
        (
            Metric("iae_h", "m s", "integral of |h - h_d|"),
            Metric("iae_theta", "rad s", "integral of |theta - theta_d|"),
            Metric("late_variation", "N", f"total variation of the force in the last {_LATE:g} s"),
        ),
        _START,
        _finish,
        _sample,
        _close,
        (round((horizon - _LATE) / period),),
    )
