"""What the article leaves unprinted, recovered from its cells: LQR weights and observer slopes from Table 5.

One generation of the optimiser is one batch: every candidate takes eight slots, four cases times two arms, on the
nominal plant (the levels of uncertainty hardly move Table 5's averages, far less than the fit error).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from ..article import Cell, published
from ..controllers import LQR
from ..observers import SlidingModeObserver
from ..plant import CartPendulum
from ..wrappers import VectorObserverWrapper
from .rollout import rollout

Array = NDArray[np.float64]
ARMS = ("without", "with")
STATES = ("h", "theta")
# name, lower and upper bound (steeper slopes are not stable at 1 ms); all are searched on a logarithmic scale
PARAMETERS = (
    ("q_h", 1.0, 1e3),
    ("q_theta", 1.0, 1e3),
    ("q_h_dot", 1.0, 1e3),
    ("q_theta_dot", 1e-2, 1e2),
    ("k_p", 3.0, 45.0),
    ("k_v", 3.0, 45.0),
)
NAMES = tuple(name for name, _, _ in PARAMETERS)
BOUNDS = np.log10([[low, high] for _, low, high in PARAMETERS])


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


@dataclass(frozen=True, slots=True)
class Table5:
    """The sixteen LQR cells of Table 5 as a function of the parameters."""

    cases: dict[str, tuple[float, ...]]
    control_period: float

    def cells(self) -> list[Cell]:
        """In the order of :meth:`deviations`."""
        return [Cell("5", "lqr", "", c, "mse", s, arm) for c in self.cases for arm in ARMS for s in STATES]

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each cell at points (m, parameters) on the log10 scale, (m, 16).

        A run that diverges counts as a hundredfold MSE, so that the search leads away from it.
        """
        model = CartPendulum(gravity=hypothesis.gravity)
        starts = [start for start in self.cases.values() for _ in ARMS]
        gains, observers = [], []
        for point in 10.0 ** np.asarray(points):
            gains.append(np.repeat(LQR.design(point[:4], 1.0, model).K, len(starts), axis=0))
            base = SlidingModeObserver(slopes=(point[4], point[5]), time_constant=hypothesis.time_constant, model=model)
            for start in self.cases.values():
                xhat0: Any = start if hypothesis.estimate_starts_at_truth else (0.0, 0.0, 0.0, 0.0)
                observers += [replace(base, compensation=arm == "with", xhat0=xhat0) for arm in ARMS]
        n = len(observers)
        env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
            "SMOPendulum-v0",
            n,
            autoreset_mode=AutoresetMode.DISABLED,
            control_period=self.control_period,
            horizon=hypothesis.horizon,
            force_limit=None,
            track_limit=50.0,
            params=model,
        )
        found = rollout(
            VectorObserverWrapper(env, observers),
            LQR(np.concatenate(gains)),
            options={"state": np.tile(starts, (len(points), 1)), "params": np.tile(model.as_array(), (n, 1))},
        )
        mse = np.stack([found.metrics[f"mse_{s}"] for s in STATES], axis=-1)
        printed = np.array([published()[cell] for cell in self.cells()])
        measured = np.where(found.failed[:, None], np.nan, mse).reshape(len(points), -1)
        return np.where(np.isfinite(measured), np.log(measured / printed), math.log(100.0))

    def cost(self, points: Array, hypothesis: Hypothesis) -> Array:
        """Sum of squared deviations at each point, (m,)."""
        return np.asarray((self.deviations(points, hypothesis) ** 2).sum(axis=1))


class Search:
    """CMA-ES from one random start; its whole state is data, so that it can be interrupted and resumed.

    Args:
        problem: the cells.
        hypothesis: what is taken for granted.
        seed: of the start and of the search.
        population: candidates a generation.

    Raises:
        ImportError: the package cma is missing.
    """

    def __init__(self, problem: Table5, hypothesis: Hypothesis, seed: int, population: int = 12) -> None:
        try:
            import cma
        except ImportError:
            raise ImportError('identification needs cma: pip install "smo_gym[reference]"') from None
        self.problem, self.hypothesis = problem, hypothesis
        self._generator = np.random.default_rng(seed)
        low, high = BOUNDS.T
        start = self._generator.uniform(low, high)
        options: dict[str, Any] = {
            "bounds": [low.tolist(), high.tolist()],
            "popsize": population,
            "randn": self._normal,
            "seed": math.nan,  # it draws from our generator alone
            "verbose": -9,
        }
        self.strategy: Any = cma.CMAEvolutionStrategy(start, 0.3, options)
        self.best, self.best_cost, self.generations = start, math.inf, 0

    def _normal(self, *shape: int) -> Array:
        return self._generator.standard_normal(shape)

    def step(self) -> float:
        """One generation; the best cost so far."""
        points = np.array(self.strategy.ask())
        costs = self.problem.cost(points, self.hypothesis)
        self.strategy.tell(list(points), costs.tolist())
        self.generations += 1
        i = int(costs.argmin())
        if costs[i] < self.best_cost:
            self.best, self.best_cost = points[i], float(costs[i])
        return self.best_cost

    @property
    def rms(self) -> float:
        """RMS of log(measured / published) at the best point."""
        return math.sqrt(self.best_cost / 16)


def profile(problem: Table5, hypothesis: Hypothesis, point: Array, factors: Sequence[float]) -> Array:
    """RMS deviations when one parameter at a time is multiplied by a factor, (parameters, factors).

    How fast they rise says how well each parameter is determined (the others are held, so it is a lower bound of the
    uncertainty).
    """
    points = [point + math.log10(f) * unit for unit in np.eye(len(point)) for f in factors]
    costs = problem.cost(np.array(points), hypothesis)
    return np.asarray(np.sqrt(costs / 16).reshape(len(point), len(factors)))
