"""Remark 2: the time of convergence can be made small, and what that costs behind noise."""

import numpy as np
import pytest

from smo_gym import CartPendulum
from smo_gym.evaluation import configs, scenario, theorem_sweep

RUNS = 24


@pytest.fixture(scope="module")
def rows():
    settings = scenario.load_theorem(configs.path("theorem"))
    low, high = np.array(settings.starts.value)
    starts = theorem_sweep.edge(low, high, RUNS, np.random.default_rng(3))
    law = scenario.named("initial-conditions").agent("lqr")
    over = settings.over(CartPendulum())
    return [*theorem_sweep.sweep(over, settings.slopes.value, settings.force.value, law, starts, 3, 1e-3, 2.0)]


def test_starts_are_on_the_surface_of_the_box():
    low, high = -np.arange(1.0, 5.0), np.arange(1.0, 5.0)
    starts = theorem_sweep.edge(low, high, 200, np.random.default_rng(0))
    assert (((starts == low) | (starts == high)).sum(1) >= 1).all()
    assert ((low <= starts) & (starts <= high)).all()
    assert {*np.argmax((starts == low) | (starts == high), axis=1)} == {0, 1, 2, 3}


def test_larger_margins_converge_sooner_and_within_the_promise(rows):
    calm = [row for row in rows if row.noise == "none"]
    for finer in range(len(theorem_sweep.FINER)):
        mine = calm[finer :: len(theorem_sweep.FINER)]
        assert np.all(np.diff([row.converged for row in mine]) < 0.0)
        assert all(row.slowest < row.promised + 0.01 for row in mine)
        assert all((row.largest < row.bound).all() for row in mine)
    # the step hardly matters, as it does to no article that integrates with a small one
    assert calm[0].converged == pytest.approx(calm[1].converged, abs=0.003)


def test_noise_makes_the_larger_margin_the_worse_one(rows):
    noisy = [row for row in rows if row.noise != "none"][:: len(theorem_sweep.FINER)]
    assert (noisy[-1].largest > 2.0 * noisy[0].largest).all()
    assert all(np.isinf(row.converged) for row in noisy)
    assert "never" in noisy[0].said()
