"""What the integral sliding mode promises, run by run: where its conditions hold, sigma stays at 0."""

from __future__ import annotations

from dataclasses import dataclass

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..controllers import Condition, IntegralSlidingMode, Linear, Reaching
from ..controllers.integral_sliding_mode import PREDICTED
from ..loop import Loop
from ..observers import Oracle
from ..plant import CartPendulum
from ..typing import Array, Flags
from ..wrappers import VectorObserverWrapper
from . import law_settings
from .draws import deviations, noise
from .law_cases import DISTURBANCE, FRICTION, LEVEL, LIMIT, cases
from .rollout import rollout

PERIOD = 0.001
HORIZON = 10.0
LEAN = 0.1
"""Largest angle of a start in rad."""
BOUND = 10.0
"""Of ``|d'|`` in m/s^3: declared."""
DESIGNS = {"meets the conditions": 2.0 * BOUND, "breaks them": 0.1 * BOUND}
"""What gains are made for, in m/s^3: with room for the least gain b, and too little on purpose."""
SETTLED = 1000
"""Control periods after which sigma must be at 0: z begins at 0, and -d is not there."""
TOLERANCE = 1.0
"""Sigma counts as kept at 0 within this many times ``h^2 BOUND``, what d may change by in a step, by h."""


@dataclass(frozen=True, slots=True)
class Promise:
    """A design on all runs."""

    L: float
    """What its gains are made for, m/s^3."""
    steepest: Array
    """Largest ``|d'|`` of each run in m/s^3, (runs,)."""
    unsaturated: Flags
    """Whether the force stayed within its limit, (runs,)."""
    least_gain: float
    """Least factor b of v in any run."""
    largest: Array
    """Largest ``|sigma|`` of each run in m/s once it has settled, (runs,)."""

    @property
    def inside(self) -> Flags:
        """Which runs stayed in the set that the conditions are declared over."""
        return (self.steepest <= BOUND) & self.unsaturated

    @property
    def kept(self) -> Flags:
        """In which sigma stayed at 0."""
        return self.largest <= TOLERANCE * PERIOD**2 * BOUND

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Those on its gains, for the declared bound and the least gain."""
        return Reaching.super_twisting(self.L).conditions(BOUND, self.least_gain)


class Watch:
    """Takes d = sigma' - b v and sigma from each control period."""

    every = 1

    def __init__(self, plants: Array, K: Array, nominal: CartPendulum) -> None:
        n = len(plants)
        self.plants, self.K, self.nominal = plants, K, nominal
        self.steepest, self.largest, self.free = np.zeros(n), np.zeros(n), np.ones(n, dtype=np.bool_)
        self.least_gain = np.inf
        self._x, self._sigma, self._d = np.zeros((4, n)), np.zeros(n), np.full(n, np.nan)

    def look(self, k: int, loop: Loop) -> None:
        """Take the control period that ends at instant k."""
        if k > 0:
            sigma = loop.x[2] - loop.own("law")[PREDICTED]
            square = np.sin(self._x[1]) ** 2
            M_c, m = self.plants[:, 0], self.plants[:, 1]
            inertia = self.nominal.cart_mass + self.nominal.bob_mass * square
            b = inertia / (M_c + m * square)
            v = (loop.u + self.K @ self._x) / inertia
            d = (sigma - self._sigma) / PERIOD - b * v
            if k > 2:
                self.steepest = np.maximum(self.steepest, np.abs(d - self._d) / PERIOD)
            self.free &= np.abs(loop.u) < LIMIT
            if k >= SETTLED:
                self.largest = np.maximum(self.largest, np.abs(sigma))
            self.least_gain = min(self.least_gain, float(b.min()))
            self._sigma, self._d = sigma, d
        self._x = loop.x.copy()


def promise(L: float, runs: int, seed: int) -> Promise:
    """Runs upright, from |theta| <= 0.1 rad, under its sine and its viscous friction, on the true state.

    Without the step and Coulomb's friction, which jump: no L bounds their d'.
    """
    case = cases()["upright"]
    (sine, _), friction = DISTURBANCE, {**FRICTION, "cart_coulomb": 0.0}
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        case.environment,
        runs,
        autoreset_mode=AutoresetMode.DISABLED,
        **{**dict(case.options), "horizon": HORIZON, "control_period": PERIOD, "force_limit": LIMIT},
        disturbance=sine,
        friction=friction,
    )
    nominal: CartPendulum = env.unwrapped.task.params  # type: ignore[attr-defined]
    K = np.array(law_settings.named()["lqr"].at["upright-filtered"]["K"])
    plants = np.array([nominal.perturbed(LEVEL * draw).as_array() for draw in deviations(seed, runs)])
    lean = np.array([0.0, LEAN, 0.0, 0.0])
    starts = np.array([np.random.default_rng([seed, each, 2]).uniform(-lean, lean) for each in range(runs)])
    watch = Watch(plants, K, nominal)
    law = IntegralSlidingMode(Linear(K, PERIOD), PERIOD, Reaching.super_twisting(L, "predicting"), LIMIT, nominal)
    reset = {"state": starts, "params": plants, "noise": np.array(noise(seed, runs))}
    rollout(VectorObserverWrapper(env, Oracle()), law, options=reset, recorders=[watch])
    return Promise(L, watch.steepest, watch.free, watch.least_gain, watch.largest)
