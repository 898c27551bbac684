"""Runs of a scenario to look at, every instant of them."""

from __future__ import annotations

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ..wrappers import VectorObserverWrapper
from .draws import deviations
from .rollout import rollout
from .scenario import Scenario
from .traces import Traces


def traced(place: Scenario, controller: str, runs: int, level: float = 0.0, seed: int = 0, every: int = 1) -> Traces:
    """Runs with compensation, from each initial state in turn.

    Args:
        place: the scenario.
        controller: its name.
        runs: how many.
        level: of uncertainty.
        seed: of the plants.
        every: control periods from one kept instant to the next.
    """
    cases = [*place.initial_states.value.values()]
    env = gymnasium.make_vec(
        place.environment, runs, autoreset_mode=AutoresetMode.DISABLED, **place.environment_options
    )
    observed = VectorObserverWrapper(env, place.controllers[controller].observer.build(compensation=True))
    nominal = place.task.params
    plants = [nominal.perturbed(level * draw).as_array() for draw in deviations(seed, runs)]
    starts = [cases[i % len(cases)] for i in range(runs)]
    options = {"state": np.array(starts), "params": np.array(plants)}
    result = rollout(observed, place.agent(controller), options=options, trace_every=every)
    assert result.traces is not None
    return result.traces
