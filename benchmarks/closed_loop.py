"""The closed loop of the tables with everything in it, and the time that work takes beside other work."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from smo_gym import VectorObserverWrapper
from smo_gym.evaluation.drivers import loop_inside
from smo_gym.evaluation.guard import guard
from smo_gym.evaluation.metrics import USUAL
from smo_gym.evaluation.scenario import named
from smo_gym.loop import Loop
from smo_gym.plant import PARAMS

DT = 0.001


def closed_loop(controller: str, n: int, control_period: float = DT, **options: Any) -> Loop:
    """Regulation on n plants with 20 % uncertainty: observer, force limit, guard, metrics and judge.

    Args:
        controller: of the scenario, by name.
        n: number of plants.
        control_period: in s.
        **options: of the environment.
    """
    scenario = named("regulation").changed(control_period=control_period)
    settings = scenario.controllers[controller]
    env = gymnasium.make_vec(
        scenario.environment, n, autoreset_mode=AutoresetMode.DISABLED, **scenario.environment_options, **options
    )
    inner = loop_inside(VectorObserverWrapper(env, settings.observer.build(True)))
    assert inner is not None
    (plant,) = inner.loop.parts["plant"]
    rows = plant.rows.copy()
    rows[PARAMS : PARAMS + 3] *= np.random.default_rng(1).uniform(0.8, 1.2, (3, n))
    return inner.loop.with_parts(
        law=settings.build(control_period).part(n),
        plant=replace(plant, rows=rows),
        guard=guard(inner.loop),
        metrics=USUAL.part(n),
    )


def begin(loop: Loop) -> None:
    """Start all slots at states about Table 4's."""
    loop.start(slice(None), np.random.default_rng(0).uniform(-1.5, 1.5, (4, loop.n)))


def run(loop: Loop, steps: int) -> Callable[[], float]:
    """Work that begins anew and tells the nanoseconds of this thread that a step of a slot takes."""

    def work() -> float:
        begin(loop)
        began = time.thread_time()
        loop.run(0, steps // loop.substeps)
        return (time.thread_time() - began) * 1e9 / (steps * loop.n)

    return work


def least(works: Mapping[str, Callable[[], float]], repeats: int) -> dict[str, float]:
    """The least that each work tells, by turns: what else the machine does falls on all of them alike."""
    for work in works.values():
        work()  # compiles
    told = [{name: work() for name, work in works.items()} for _ in range(repeats)]
    return {name: min(each[name] for each in told) for name in works}
