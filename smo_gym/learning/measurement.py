"""What a policy does on plants that it has not learned on."""

from __future__ import annotations

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ..evaluation.rollout import rollout
from ..policies.frozen import MlpPolicy
from ..wrappers import VectorObserverWrapper
from ..wrappers.view import KINDS

TRAINING, VALIDATION, TEST = range(3)
"""Streams of seeds: what a policy learns on, is watched on while it learns, and is measured on at the end."""


def seeds(stream: int, n: int, *key: int) -> list[int]:
    """N seeds of a stream."""
    return [int(seed) for seed in np.random.SeedSequence(key, spawn_key=(stream,)).generate_state(n)]


def measure(policy: MlpPolicy, stream: int = TEST, runs: int = 100, horizon: float | None = None) -> dict[str, float]:
    """A policy on random plants and starts of its training, over the environment's own horizon or another.

    Returns:
        Runs, how many failed, and the means of the others' MSE of h in m^2 and of theta in rad^2.
    """
    card = policy.card
    options = {name: value for name, value in card.configuration["options"].items() if name != "horizon"}
    options |= {} if horizon is None else {"horizon": horizon}
    env = gymnasium.make_vec(card.environment, runs, autoreset_mode=AutoresetMode.DISABLED, **options)
    observer = KINDS[card.observation].observer
    outcome = rollout(VectorObserverWrapper(env, **observer) if observer else env, policy, seed=seeds(stream, 1)[0])
    stood = ~outcome.failed
    means = {name: float(outcome.metrics[name][stood].mean()) for name in ("mse_h", "mse_theta")} if stood.any() else {}
    return {"runs": int(runs), "failed": int(outcome.failed.sum()), **means}
