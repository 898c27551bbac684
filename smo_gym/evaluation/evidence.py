"""What is computed to judge what the article proves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..controllers import LQR
from ..plant import CartPendulum
from . import configs, scenario, theorem_sweep
from .claims_of_theory import Evidence
from .exact import exact
from .store import Store
from .theorem_pieces import RUNS, converge_in_pieces, drawn
from .tracing import traced

SWEPT, SWEPT_SECONDS, DT = 50, 3.0, 0.001
"""Runs of the sweep and of the exact sgn, how long they are and their sampling period in s."""
SLIDING, LEVEL, EVERY = 100, 0.2, 5
"""Runs of SMC that are looked at, of what uncertainty, and at every so many control periods."""
WORK = RUNS + len(theorem_sweep.DESIGNS) + 3
"""What the progress is told in all."""


def evidence(seed: int, store: Store | None, told: Callable[[int], object]) -> Evidence:
    """Run it all.

    Args:
        seed: of starts and plants.
        store: keeps the theorem's runs.
        told: called with the work done since the last call, of :data:`WORK` in all.
    """
    settings = scenario.load_theorem(configs.path("theorem"))
    over = settings.over(CartPendulum())
    article, force = scenario.named("initial-conditions"), settings.force.value
    law = article.agent("lqr")
    assert isinstance(law, LQR)
    starts, plants = drawn(settings, over, RUNS, seed)
    designed = settings.build(DT, over.model)
    limits = {"force": force, "horizon": settings.horizon.value, "settle": settings.settle.value}
    converged = converge_in_pieces(
        {"designed": designed}, law, over, starts, plants, **limits, store=store, progress=told
    )
    low, high = np.array(settings.starts.value)
    edge = theorem_sweep.edge(low, high, SWEPT, np.random.default_rng(seed))
    given = (over, settings.slopes.value, force, law, edge, seed, DT, SWEPT_SECONDS)
    swept = [*theorem_sweep.sweep(*given, told=told)]
    coarse = swept[:: 2 * len(theorem_sweep.FINER)]  # the first of each margin: the longest step, no noise
    of_exact = exact(over, settings.margin.value, force, law, edge, seed, SWEPT_SECONDS)
    told(1)
    along = {name: traced(article, name, len(article.initial_states.value), 0.0, seed, 1) for name in ("lqr", "smc")}
    told(1)
    sliding = traced(scenario.named("regulation").from_one_start(), "smc", SLIDING, LEVEL, seed, EVERY)
    told(1)
    return Evidence(converged, coarse, of_exact, along, sliding)
