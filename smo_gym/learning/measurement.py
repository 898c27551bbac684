"""What a policy does on plants that it has not learned on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ..controllers import Agent
from ..evaluation import scenario
from ..evaluation.rollout import rollout
from ..loop import Loop
from ..policies.frozen import Card, MlpPolicy
from ..wrappers import VectorObserverWrapper
from ..wrappers.view import KINDS

SCENARIOS = {
    "SMOPendulum-v0": "regulation",
    "SMOPendulumUpright-v0": "upright",
    "SMOPendulumTracking-v0": "tracking",
}
"""Where the LQR of an environment is described."""
TRAINING, VALIDATION, TEST = range(3)
"""Streams of seeds: what a policy learns on, is watched on while it learns, and is measured on at the end."""


def seeds(stream: int, n: int, *key: int) -> list[int]:
    """N seeds of a stream."""
    return [int(seed) for seed in np.random.SeedSequence(key, spawn_key=(stream,)).generate_state(n)]


class Returns:
    """The sum of the rewards of every slot's episode."""

    every = 1

    def __init__(self, n: int) -> None:
        self.total = np.zeros(n)

    def look(self, k: int, loop: Loop) -> None:
        """Add the rewards of the period that ends at instant k: 0 at the start and in slots that have ended."""
        self.total += loop.reward


def measure(policy: MlpPolicy, stream: int = TEST, runs: int = 100, horizon: float | None = None) -> dict[str, float]:
    """A policy on random plants and starts of its training, over the environment's own horizon or another.

    Returns:
        Runs, how many failed, the means over all of the return and of the time until the run failed or ended in s, and
        over those that did not fail of the MSE of h in m^2 and of theta in rad^2.
    """
    return _measured(policy.card, policy, KINDS[policy.card.observation].observer, stream, runs, horizon)


def measure_lqr(card: Card, runs: int = 100) -> dict[str, float] | None:
    """The article's LQR on its SMO, in a policy's place on its test plants; None where it has none for these.

    It acts as often as the policy.
    """
    if card.environment not in SCENARIOS:
        return None
    place = scenario.named(SCENARIOS[card.environment])
    observer = place.controllers["lqr"].observer.build(compensation=True)
    return _measured(card, place.agent("lqr"), {"observer": observer}, TEST, runs, None)


def _measured(
    card: Card, agent: Agent, observer: Mapping[str, Any] | None, stream: int, runs: int, horizon: float | None
) -> dict[str, float]:
    options = {name: value for name, value in card.configuration["options"].items() if name != "horizon"}
    options |= {} if horizon is None else {"horizon": horizon}
    env = gymnasium.make_vec(card.environment, runs, autoreset_mode=AutoresetMode.DISABLED, **options)
    seen, returns = VectorObserverWrapper(env, **observer) if observer else env, Returns(runs)
    outcome = rollout(seen, agent, seed=seeds(stream, 1)[0], recorders=[returns])
    stood = ~outcome.failed
    means = {name: float(outcome.metrics[name][stood].mean()) for name in ("mse_h", "mse_theta")} if stood.any() else {}
    of_all = {"return": float(returns.total.mean()), "standing": float(outcome.metrics["duration"].mean())}
    return {"runs": int(runs), "failed": int(outcome.failed.sum()), **of_all, **means}
