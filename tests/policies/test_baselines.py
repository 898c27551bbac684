"""The shipped policies do what their cards and the README say."""

import gymnasium
import numpy as np
import pytest

from smo_gym import CartPendulum, VectorObserverWrapper
from smo_gym.evaluation import rollout, scenario, study
from smo_gym.evaluation.draws import deviations
from smo_gym.learning.measurement import measure
from smo_gym.policies import BASELINES, shipped
from smo_gym.wrappers.view import KINDS

TABLE_4 = scenario.named("regulation")


@pytest.mark.parametrize("environment", BASELINES)
def test_they_measure_what_their_cards_say(environment):
    policy = shipped(environment)
    assert policy.card.environment == environment
    assert policy.card.observation == "smo"
    assert policy.card.command.startswith("python agents/train.py")
    found = measure(policy)
    assert {key: found[key] for key in policy.card.measured} == pytest.approx(policy.card.measured, rel=1e-3)
    assert policy.card.measured["failed"] == 0
    assert policy.card.curve[-1]["steps"] >= policy.card.configuration["steps"]


def table_4(agent, observer, control_period):
    """Mean over Table 4's cells of MSE of h plus MSE of theta under 30 N, five plants a level."""
    draws = deviations(0, 5)
    plants = [CartPendulum().perturbed(x * draw).as_array() for x in TABLE_4.uncertainty.value for draw in draws]
    options = {"control_period": control_period, "force_limit": 30.0}
    env = gymnasium.make_vec("SMOPendulum-v0", len(plants), autoreset_mode="Disabled", **options)
    start = TABLE_4.initial_states.value[""]
    result = rollout(VectorObserverWrapper(env, observer), agent, options={"state": start, "params": np.array(plants)})
    assert not result.failed.any()
    return float(np.mean(result.metrics["mse_h"] + result.metrics["mse_theta"]))


def test_better_than_the_identified_lqr_on_table_4():
    policy, lqr = shipped("SMOPendulum-v0"), TABLE_4.controllers["lqr"]
    observer = lqr.observer.build(compensation=True)
    assert KINDS["smo"].observer["slopes"] == observer.slopes
    learned = table_4(policy, observer, 0.02)
    assert learned < 0.9 * table_4(lqr.build(0.02), observer, 0.02)
    assert learned < 0.9 * table_4(lqr.build(0.001), observer, 0.001)


def test_upright_none_of_a_hundred_plants_falls():
    policy = shipped("SMOPendulumUpright-v0")
    env = gymnasium.make_vec("SMOPendulumUpright-v0", 100, autoreset_mode="Disabled", uncertainty=0.2)
    starts = np.zeros((100, 4))
    starts[:, 1] = np.linspace(-0.2, 0.2, 100)
    result = rollout(VectorObserverWrapper(env, **KINDS["smo"].observer), policy, seed=0, options={"state": starts})
    assert not result.failed.any()
    assert result.metrics["duration"] == pytest.approx(np.full(100, 35.0))


def test_what_is_measured_beside_it_does_not_change_a_bit():
    """One batch holds all arms and plants of a study; the policy's sums do not depend on its size."""
    place = TABLE_4.changed(horizon=1.0, force_limit=30.0).with_agent("ppo")

    def errors(controllers, arms):
        outcomes = study.measure(study.groups([place], controllers, arms, 3), 0)
        return [
            outcome.metrics["mse_h"]
            for outcome in outcomes
            if (outcome.group.controller, outcome.group.arm) == ("ppo", "with")
        ]

    alone = errors(["ppo"], ["with"])
    assert len(alone) == len({0.0, *place.uncertainty.value})
    assert all(map(np.array_equal, alone, errors(["ppo"], ["without", "with", "oracle"])))
    assert all(map(np.array_equal, alone, errors(["lqr", "ppo"], ["without", "with"])))
