"""Studies: what single runs give, and more of them."""

import gymnasium
import numpy as np
import pytest
from conftest import SMALL

import smo_gym
from smo_gym import LQR, CartPendulum
from smo_gym.evaluation import configs, scenario, study
from smo_gym.evaluation.draws import deviations
from smo_gym.plant import STATE_NAMES

K = [7.234, -4.132, 11.075, -1.025]


def test_a_controller_may_begin_elsewhere(small):
    own = {"": (0.5, 0.2, 0.0, 0.0)}
    lqr = small.controllers["lqr"]
    apart = small.changed(controllers={"lqr": lqr, "near": lqr.changed(initial_states=own)})

    def seen(place, name):
        groups = study.groups([place], [name], ["with"], 2)
        return [(o.group.start, *o.metrics["mse_h"]) for o in study.measure(groups, 0)]

    assert seen(apart, "near") == seen(small.changed(initial_states=own), "lqr")
    assert seen(apart, "near")[0][0] == own[""]
    assert seen(apart, "lqr") == seen(small, "lqr") == seen(apart.from_one_start(), "near")
    # who enters meets the others on equal terms
    assert apart.with_agent("ppo").starts("near") == small.initial_states.value


def test_a_study_is_what_single_runs_give(small):
    groups = study.groups([small], ["lqr"], ["without", "with", "oracle"], 3)
    assert [(g.uncertainty, g.arm, g.runs) for g in groups][:4] == [
        (0.0, "without", 1),
        (0.0, "with", 1),
        (0.0, "oracle", 1),
        (0.1, "without", 3),
    ]
    outcomes = study.measure(groups, seed=7)
    delta = np.random.default_rng([7, 2]).uniform(-1, 1, 3)
    for arm in ("without", "with", "oracle"):
        (outcome,) = (o for o in outcomes if o.group.arm == arm and o.group.uncertainty == 0.2)
        settings = {} if arm == "oracle" else {"compensation": arm == "with", "slopes": (12.0, 12.0)}
        env = gymnasium.make("SMOPendulum-v0", **small.environment_options)
        env = smo_gym.ObserverWrapper(env, "oracle" if arm == "oracle" else "smo", **settings)
        plant = CartPendulum().perturbed(0.2 * delta)
        observation, _ = env.reset(options={"state": [1.0, 1.0, 0.1, 0.01], "params": plant})
        squares, truncated = [], False
        while not truncated:
            observation, _, _, truncated, info = env.step(LQR(K).predict(observation)[0])
            squares += [*info["samples"][:, 1] ** 2]
        assert outcome.metrics["mse_theta"][2] == pytest.approx(np.mean(squares), rel=1e-12)


def test_the_nominal_plant_runs_as_often_as_the_others_where_it_is_random(small):
    def runs(**options):
        return [group.runs for group in study.groups([small.with_options(**options)], ["lqr"], ["with"], 3)]

    assert runs(sensor="encoders") == runs(friction_uncertainty=0.1) == [1, 3, 3]
    assert runs(disturbance={"kind": "noise", "force": 1.0}) == [3, 3, 3]
    noisy = small.with_options(sensor={"noise": (0.0, 1e-2)})
    nominal, *_ = study.measure(study.groups([noisy], ["lqr"], ["with"], 3), seed=0)
    assert len({*nominal.metrics["mse_theta"]}) == 3
    assert np.ptp(nominal.plants, axis=0).max() == 0.0


def test_a_push_is_not_counted_as_leaving_the_set_of_designed_gains():
    place = scenario.load(configs.path("initial-conditions"))
    peaks = {f"{peak}_{name}": np.zeros(1) for peak in ("peak", "peak_estimate") for name in STATE_NAMES[1:]}
    metrics = {**peaks, "peak_force": np.zeros(1)}

    def left(given):
        group, *_ = study.groups([given], ["lqr"], ["theorem"], 1)
        return study.Outcome(group, metrics, np.zeros(1, dtype=np.bool_)).left

    assert left(place).tolist() == [False]
    assert left(place.with_options(disturbance="push")) is None


def test_more_runs_add_to_those_that_were_there():
    assert (deviations(3, 20)[:5] == study.deviations(3, 5)).all()
    assert (deviations(4, 5) != study.deviations(3, 5)).all()


def test_a_scenario_of_the_upright_plant_is_upright(tmp_path):
    path = tmp_path / "upright.yaml"
    changes = (
        ("SMOPendulum-v0", "SMOPendulumUpright-v0"),
        ("[7.234, -4.132, 11.075, -1.025]", "[-3.16, -101.39, -7.16, -21.04]"),
    )
    text = SMALL.read_text().replace("[1.0, 1.0, 0.1, 0.01]", "[0.0, 0.1, 0.0, 0.0]")
    for change in changes:
        text = text.replace(*change)
    path.write_text(text.replace("{value: 1.0,", "{value: 5.0,"))
    groups = study.groups([scenario.load(path)], ["lqr"], ["with", "oracle"], 2)
    for outcome in study.measure(groups, seed=0):
        assert not outcome.failed.any()
        assert outcome.metrics["peak_theta"].max() < 0.5
        assert outcome.metrics["mse_theta"].max() < 0.1**2
    hanging_gain = scenario.load(path).changed(environment="SMOPendulum-v0")
    assert all(
        o.metrics["mse_h"].max() > 1.0
        for o in study.measure(study.groups([hanging_gain], ["lqr"], ["oracle"], 1), seed=0)
    )
