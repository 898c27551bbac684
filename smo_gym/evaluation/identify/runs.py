"""Mean square errors of many candidates at once: each takes the slots of its starts, arms and plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ...article import WITH
from ...controllers import Agent
from ...observers import SlidingModeObserver
from ...plant import CartPendulum
from ...typing import Array
from ...wrappers import VectorObserverWrapper
from ..arms import PRINTED
from ..draws import deviations as draws
from ..rollout import rollout
from ..scenario import Scenario
from .search import Hypothesis

STATES = ("h", "theta")


def mse(
    scenario: Scenario,
    hypothesis: Hypothesis,
    observers: Sequence[SlidingModeObserver],
    agent: Callable[[int], Agent],
    starts: Array,
    plants: Array,
) -> Array:
    """Mean square errors (candidates, starts, arms, plants, states), NaN where a run failed.

    Args:
        scenario: gives the environment.
        hypothesis: what is taken for granted instead of the scenario's settings.
        observers: one a candidate.
        agent: of all candidates, for so many consecutive slots each.
        starts: x(0), (candidates, starts, 4), or (candidates, starts, plants, 4) where it differs from run to run.
        plants: [M_c, m, l, g], (plants, 4), or (candidates, plants, 4).
    """
    if hypothesis.horizon is not None:
        scenario = scenario.changed(horizon=hypothesis.horizon)
    if hypothesis.elements is not None and scenario.reference is not None:
        scenario = scenario.changed(reference=scenario.reference.changed(elements=hypothesis.elements))
    m, cases, n = len(observers), starts.shape[1], plants.shape[-2]
    shape = (m, cases, len(PRINTED), n)
    each_start, each_plant = _spread(starts, plants, shape)
    each = [
        replace(
            observer,
            compensation=arm == WITH,
            time_constant=hypothesis.time_constant,
            xhat0=tuple(x0) if hypothesis.estimate_starts_at_truth else observer.xhat0,
        )
        for observer, of_candidate in zip(observers, each_start, strict=True)
        for of_case in of_candidate
        for arm, of_arm in zip(PRINTED, of_case, strict=True)
        for x0 in of_arm
    ]
    options: dict[str, Any] = {**scenario.environment_options, "track_limit": 50.0}
    if scenario.reference is None:
        options["params"] = CartPendulum(gravity=hypothesis.gravity)
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        scenario.environment, len(each), autoreset_mode=AutoresetMode.DISABLED, **options
    )
    found = rollout(
        VectorObserverWrapper(env, each),
        agent(len(each) // m),
        options={"state": each_start.reshape(-1, 4), "params": each_plant.reshape(-1, 4)},
    )
    errors = np.stack([found.metrics[f"mse_{s}"] for s in STATES], axis=-1)
    errors[found.failed] = np.nan
    return errors.reshape(*shape, len(STATES))


def _spread(starts: Array, plants: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """x(0) and plant of every run, (candidates, starts, arms, plants, 4) each."""
    per_run = starts[:, :, None] if starts.ndim == 4 else starts[:, :, None, None]
    of_candidate = plants[:, None, None] if plants.ndim == 3 else plants
    x0, params = (np.array(np.broadcast_to(values, (*shape, 4))) for values in (per_run, of_candidate))
    return x0, params


def random_plants(levels: Sequence[float], each: int, gravity: float = -9.8) -> Array:
    """``each`` random plants at each level of uncertainty, (levels * each, 4), other draws at each."""
    model = CartPendulum(gravity=gravity)
    deltas = np.concatenate([level * draws(i, each) for i, level in enumerate(levels)])
    return np.array([model.perturbed(delta).as_array() for delta in deltas])
