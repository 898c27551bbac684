"""What the article leaves unprinted, recovered from its cells by CMA-ES.

One generation of the optimiser is one batch: every candidate takes the slots of its cells, cases times arms times
plants. Three problems: LQR weights and observer slopes from Table 5, SMC gains and slopes from Table 5, SMC gains of
tracking from Table 7's averages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from ..article import Cell, published
from ..controllers import LQR, SlidingModeController
from ..observers import SlidingModeObserver
from ..plant import CartPendulum
from ..wrappers import VectorObserverWrapper
from .rollout import Agent, rollout
from .scenario import Scenario, SmcSettings
from .study import deviations as draws

Array = NDArray[np.float64]
ARMS = ("without", "with")
STATES = ("h", "theta")
# A run that diverges counts as a hundredfold MSE, so that the search leads away from it.
_DIVERGED = math.log(100.0)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What is taken for granted while the parameters are searched."""

    name: str = "as in configs/"
    gravity: float = -9.8
    horizon: float = 35.0
    estimate_starts_at_truth: bool = False
    time_constant: float = 0.0


ALTERNATIVES = (
    Hypothesis("g = +9.8 m/s^2", gravity=9.8),
    Hypothesis("xhat(0) = x(0)", estimate_starts_at_truth=True),
    Hypothesis("low-pass of 50 ms", time_constant=0.05),
    Hypothesis("horizon 20 s", horizon=20.0),
    Hypothesis("horizon 30 s", horizon=30.0),
    Hypothesis("horizon 40 s", horizon=40.0),
)


class Problem(Protocol):
    """Published numbers as a function of unprinted settings."""

    parameters: dict[str, tuple[float, float]]
    """Name to bounds; all are searched on a logarithmic scale."""
    alternatives: tuple[Hypothesis, ...]
    """Hypotheses to reject."""

    def labels(self) -> list[str]:
        """The numbers that are fitted."""
        ...

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each number at points (m, parameters) on the log10 scale, (m, numbers)."""
        ...


def cost(problem: Problem, points: Array, hypothesis: Hypothesis) -> Array:
    """RMS of log(measured / published) at each point, (m,)."""
    return np.asarray(np.sqrt(np.mean(problem.deviations(points, hypothesis) ** 2, axis=1)))


@dataclass(frozen=True, slots=True)
class _Slots:
    """One candidate's slots: a start, a plant and an arm each, in the order cases, arms, plants."""

    starts: Array
    plants: Array
    arms: tuple[str, ...]

    @classmethod
    def of(cls, starts: Sequence[Sequence[float]], plants: Array) -> _Slots:
        each = [(x0, arm, plant) for x0 in starts for arm in ARMS for plant in plants]
        return cls(np.array([x0 for x0, _, _ in each]), np.array([p for _, _, p in each]), tuple(a for _, a, _ in each))

    def mse(
        self,
        settings: Sequence[SlidingModeObserver],
        agent: Agent,
        hypothesis: Hypothesis,
        environment: str,
        **options: Any,
    ) -> Array:
        """Mean square errors (candidates, cases, arms, plants, states), NaN where a run failed."""
        observers = [
            replace(
                one,
                compensation=arm == "with",
                time_constant=hypothesis.time_constant,
                xhat0=tuple(x0) if hypothesis.estimate_starts_at_truth else one.xhat0,
            )
            for one in settings
            for x0, arm in zip(self.starts.tolist(), self.arms, strict=True)
        ]
        m = len(settings)
        env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
            environment, len(observers), autoreset_mode=AutoresetMode.DISABLED, **{**options, "track_limit": 50.0}
        )
        found = rollout(
            VectorObserverWrapper(env, observers),
            agent,
            options={"state": np.tile(self.starts, (m, 1)), "params": np.tile(self.plants, (m, 1))},
        )
        errors = np.stack([found.metrics[f"mse_{s}"] for s in STATES], axis=-1)
        errors[found.failed] = np.nan
        n_plants = len(np.unique(self.plants, axis=0))
        return errors.reshape(m, -1, len(ARMS), n_plants, len(STATES))


def _against(measured: Array, printed: Array) -> Array:
    """log(measured / printed) of candidates (m, ...) beside one table (...), flattened to (m, numbers)."""
    flat = measured.reshape(len(measured), -1)
    return np.where(np.isfinite(flat), np.log(flat / printed.ravel()), _DIVERGED)


class Table5:
    """The sixteen cells of Table 5 of one controller: "lqr" (nominal plant) or "smc" (random plants).

    The nominal plant will do for LQR: the level of uncertainty moves the averages far less than the fit error. SMC is
    sensitive, and is averaged over plants.
    """

    def __init__(self, scenario: Scenario, controller: str, plants: int = 6) -> None:
        self.scenario, self.controller = scenario, controller
        if controller == "lqr":
            weights = dict.fromkeys(("q_h", "q_theta", "q_h_dot"), (1.0, 1000.0))
            self.parameters = {**weights, "q_theta_dot": (1e-2, 1e2), "k_p": (3.0, 45.0), "k_v": (3.0, 45.0)}
            self.alternatives: tuple[Hypothesis, ...] = ALTERNATIVES
            deltas = np.zeros((1, 3))
        else:
            gains = {f"k{i}": (0.1, 10.0) for i in (1, 2, 3, 4)}
            self.parameters = {**gains, "slope": (5.0, 150.0), "k_p": (3.0, 45.0), "k_v": (3.0, 45.0)}
            self.alternatives = ()
            deltas = scenario.uncertainty.value[0] * draws(0, plants)
        self._deltas = deltas
        self._cells = [
            [[published()[Cell("5", controller, "", c, "mse", s, arm)] for s in STATES] for arm in ARMS]
            for c in scenario.initial_states.value
        ]

    def labels(self) -> list[str]:
        """Case, arm, state."""
        return [f"case {c}, {arm}, {s}" for c in self.scenario.initial_states.value for arm in ARMS for s in STATES]

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """As :class:`Problem`."""
        model = CartPendulum(gravity=hypothesis.gravity)
        plants = np.array([model.perturbed(delta).as_array() for delta in self._deltas])
        slots = _Slots.of(list(self.scenario.initial_states.value.values()), plants)
        values, n, dt = 10.0 ** np.asarray(points), len(slots.arms), self.scenario.control_period.value
        agent: Agent
        if self.controller == "lqr":
            agent = LQR(np.repeat([LQR.design(v[:4], 1.0, model).K[0] for v in values], n, axis=0))
        else:
            agent = SlidingModeController(np.repeat(values[:, :4], n, axis=0), dt, np.repeat(values[:, 4], n))
        observers = [SlidingModeObserver(self.controller, slopes=(v[-2], v[-1]), model=model) for v in values]
        options = {**self.scenario.options, "horizon": hypothesis.horizon, "params": model}
        mse = slots.mse(observers, agent, hypothesis, self.scenario.environment, **options)
        return _against(mse.mean(axis=3), np.array(self._cells))


class Table7:
    """The four column averages of Table 7 as a function of k1..k4; all else is as in ``configs/tracking.yaml``."""

    def __init__(self, scenario: Scenario, plants: int = 4) -> None:
        self.scenario = scenario
        settings = scenario.controllers["smc"]
        assert isinstance(settings, SmcSettings)
        self._settings = settings
        self.parameters = {f"k{i}": (0.1, 10.0) for i in (1, 2, 3, 4)}
        self.alternatives: tuple[Hypothesis, ...] = ()
        levels = scenario.uncertainty.value
        self._deltas = np.concatenate([level * draws(i, plants) for i, level in enumerate(levels)])
        self._averages = [
            [
                np.mean([published()[Cell("7", "smc-tracking", f"{100 * x:g}", "", "mse", s, arm)] for x in levels])
                for s in STATES
            ]
            for arm in ARMS
        ]
        self._options = scenario.options

    def labels(self) -> list[str]:
        """Arm, state."""
        return [f"average, {arm}, {s}" for arm in ARMS for s in STATES]

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """As :class:`Problem`; the horizon is the reference's."""
        plants = np.array([CartPendulum().perturbed(delta).as_array() for delta in self._deltas])
        slots = _Slots.of(list(self.scenario.initial_states.value.values()), plants)
        k = np.repeat(10.0 ** np.asarray(points), len(slots.arms), axis=0)
        agent = SlidingModeController(k, self.scenario.control_period.value, self._settings.slope.value)
        observers = [self._settings.observer.build(compensation=True)] * len(points)
        mse = slots.mse(observers, agent, hypothesis, self.scenario.environment, **self._options)
        return _against(mse.mean(axis=(1, 3)), np.array(self._averages))


class Search:
    """CMA-ES from one random start; its whole state is data, so that it can be interrupted and resumed.

    Args:
        problem: the published numbers.
        hypothesis: what is taken for granted.
        seed: of the start and of the search.
        population: candidates a generation.

    Raises:
        ImportError: the package cma is missing.
    """

    def __init__(self, problem: Problem, hypothesis: Hypothesis, seed: int, population: int = 12) -> None:
        try:
            import cma
        except ImportError:
            raise ImportError('identification needs cma: pip install "smo_gym[reference]"') from None
        self.problem, self.hypothesis = problem, hypothesis
        self._generator = np.random.default_rng(seed)
        low, high = np.log10(list(problem.parameters.values())).T
        start = self._generator.uniform(low, high)
        options: dict[str, Any] = {
            "bounds": [low.tolist(), high.tolist()],
            "popsize": population,
            "randn": self._normal,
            "seed": math.nan,  # it draws from our generator alone
            "verbose": -9,
        }
        self.strategy: Any = cma.CMAEvolutionStrategy(start, 0.3, options)
        self.best, self.rms, self.generations = start, math.inf, 0

    def __getstate__(self) -> dict[str, Any]:
        """All but the problem, which a resumed search is given anew."""
        return {**self.__dict__, "problem": None}

    def _normal(self, *shape: int) -> Array:
        return self._generator.standard_normal(shape)

    def step(self) -> None:
        """One generation."""
        points = np.array(self.strategy.ask())
        costs = cost(self.problem, points, self.hypothesis)
        self.strategy.tell(list(points), (costs**2).tolist())
        self.generations += 1
        i = int(costs.argmin())
        if costs[i] < self.rms:
            self.best, self.rms = points[i], float(costs[i])


def profile(problem: Problem, hypothesis: Hypothesis, point: Array, factors: Sequence[float]) -> Array:
    """RMS deviations when one parameter at a time is multiplied by a factor, (parameters, factors).

    How fast they rise says how well each parameter is determined (the others are held, so it is a lower bound of the
    uncertainty).
    """
    points = [point + math.log10(f) * unit for unit in np.eye(len(point)) for f in factors]
    return cost(problem, np.array(points), hypothesis).reshape(len(point), len(factors))
