"""The tuner, and the settings that it works on."""

import math

import numpy as np
import pytest

from smo_gym.evaluation import candidates, configs
from smo_gym.evaluation.candidates import leaves, merged, with_leaves
from smo_gym.evaluation.tuning import tune
from smo_gym.observers import OBSERVERS

TREE = {"gains": {"m1": [2.0, 3.0]}, "slope": 5.0}


def test_leaves_of_a_tree_and_back():
    found = dict(leaves(TREE))
    assert found == {"gains.m1[0]": 2.0, "gains.m1[1]": 3.0, "slope": 5.0}
    assert with_leaves(TREE, iter([1.0, 2.0, 3.0])) == {"gains": {"m1": [1.0, 2.0]}, "slope": 3.0}


def test_settings_on_top_of_others():
    below = {"gains": {"m1": 1, "beta_1": 2}, "step": 3}
    assert merged(below, {"gains": {"m1": 9}, "xhat0": 4}) == {"gains": {"m1": 9, "beta_1": 2}, "step": 3, "xhat0": 4}
    assert merged(below, {"gains": "lqr"})["gains"] == "lqr"


def test_it_finds_the_minimum_and_counts_what_that_took():
    """Of a quadratic of the logarithms, whose minimum is known; one number alone, too."""
    calls = []

    def cost(tree):
        calls.append(tree)
        return sum(math.log(value / best) ** 2 for (_, value), best in zip(leaves(tree), (7.0, 0.3, 11.0), strict=True))

    found = tune(cost, TREE, budget=400, seed=3)
    assert [value for _, value in leaves(found.value)] == pytest.approx([7.0, 0.3, 11.0], rel=0.01)
    assert len(calls) == found.evaluations <= 400
    assert found.start == cost(TREE) > found.cost
    alone = tune(lambda tree: (math.log(tree["L"]) - 2.0) ** 2, {"L": 1.0}, budget=150, seed=0)
    assert alone.value["L"] == pytest.approx(math.e**2, rel=0.01)


def test_the_same_seed_finds_the_same_and_the_budget_is_kept():
    def cost(tree):
        return abs(tree["slope"] - 6.0)

    first, second = (tune(cost, TREE, budget=33, seed=5) for _ in range(2))
    assert first == second
    assert first.evaluations == 33
    told = []
    tune(cost, TREE, budget=20, seed=5, told=told.append)
    assert sum(told) == 20


def test_what_is_refused_never_wins():
    def cost(tree):
        if tree["slope"] > 6.0:
            raise ValueError("too steep")
        return -tree["slope"]

    assert 5.5 < tune(cost, TREE, budget=60, seed=1).value["slope"] <= 6.0
    with pytest.raises(ValueError, match=r"none of \d+ settings"):
        tune(lambda tree: math.nan, TREE, budget=12, seed=1)
    with pytest.raises(ValueError, match=r"gains.m1\[1\]=0"):
        tune(cost, {"gains": {"m1": [1.0, 0.0]}, "slope": 1.0}, budget=5, seed=0)


@pytest.mark.parametrize("place", [name for name in configs.names() if name.startswith("observers-")])
def test_all_candidates_of_the_package_can_be_built(place):
    for candidate in candidates.load(configs.path(place)).observers.values():
        observer = candidate.build()
        assert type(observer) is OBSERVERS[candidate.observer]
        if candidate.tuned is not None:
            assert all(value > 0.0 for _, value in leaves(candidate.tuned.value))


def test_a_candidate_that_is_not_there_and_a_setting_that_is_not():
    known = candidates.named("simulated")
    with pytest.raises(ValueError, match="smo-tuned"):
        known["smo-tund"]
    with pytest.raises(ValueError, match="slopes"):
        known["smo-tuned"].build(tuned={"slope": 3.0})


def test_other_numbers_than_the_tuned_ones():
    known = candidates.named("simulated")["smo-tuned"]
    other = known.build(tuned={**known.tuned.value, "slopes": [5.0, 6.0]})
    assert other.slopes == (5.0, 6.0)
    assert np.array_equal(other.gains.m1, known.build().gains.m1)
