"""Rollout, metrics, scenarios, statistics: against plain loops and small cases worked out by hand."""

import gymnasium
import numpy as np
import pytest
from conftest import assert_same
from scipy.linalg import expm

import smo_gym
from smo_gym import LQR, CartPendulum, SlidingModeController, SlidingModeObserver, VectorObserverWrapper
from smo_gym.article import Cell, published
from smo_gym.evaluation import rollout, scenario, statistics, study
from smo_gym.evaluation.report import tables

K = [7.234, -4.132, 11.075, -1.025]


@pytest.fixture
def closed_loop(make_vec):
    def make(n, agent=None, trace_every=None, observed=True, options=None, **task):
        env = make_vec(n, autoreset_mode="Disabled", **{"horizon": 2.0, **task})
        env = VectorObserverWrapper(env) if observed else env
        return rollout(env, agent or LQR(K), seed=0, options=options, trace_every=trace_every)

    return make


def test_metrics_are_those_of_a_plain_loop(closed_loop):
    result = closed_loop(3, trace_every=1, control_period=0.004)
    for slot in range(3):
        env = smo_gym.ObserverWrapper(gymnasium.make("SMOPendulum-v0", horizon=2.0, control_period=0.004))
        observation, info = env.reset(seed=slot)
        positions, errors, forces, states, estimates = [], [], [0.0], [], []
        truncated = False
        while not truncated:
            observation, _, _, truncated, info = env.step(LQR(K).predict(observation)[0])
            positions += [*info["samples"]]
            errors.append(observation[2:] - info["state"])
            forces.append(info["force"])
            states.append(info["state"])
            estimates.append(observation[2:])
        h, theta = np.array(positions).T
        rms = np.sqrt(np.mean(np.square(errors), axis=0))
        expected = {
            "mse_h": np.mean(h**2),
            "mse_theta": np.mean(theta**2),
            **dict(zip([f"estimation_rms_{s}" for s in ("h", "theta", "h_dot", "theta_dot")], rms, strict=True)),
            "effort": 0.004 * np.sum(np.square(forces)),
            "total_variation": np.sum(np.abs(np.diff(forces))),
            "peak_h": np.abs(h).max(),
            "peak_theta": np.abs(theta).max(),
            "peak_force": np.abs(forces).max(),
            **dict(zip(("peak_h_dot", "peak_theta_dot"), np.abs(states).max(axis=0)[2:], strict=True)),
            **dict(
                zip(
                    ("peak_estimate_theta", "peak_estimate_h_dot", "peak_estimate_theta_dot"),
                    np.abs(estimates).max(axis=0)[1:],
                    strict=True,
                )
            ),
            "duration": 2.0,
        }
        assert result.metrics.keys() == expected.keys()
        for name, value in expected.items():
            assert result.metrics[name][slot] == pytest.approx(value, rel=1e-12), name
        assert (result.traces.u[1:, slot] == forces[1:]).all()
        assert (result.traces.x[-1, :, slot] == info["state"]).all()
        assert (result.traces.xhat[-1, :, slot] == observation[2:]).all()


def test_small_motions_follow_the_linear_closed_loop(make_vec):
    x0 = np.array([1e-4, 1e-4, 0.0, 0.0])
    env = make_vec(1, autoreset_mode="Disabled", control_period=0.001, horizon=3.0, uncertainty=0.0)
    env = VectorObserverWrapper(env, "oracle")
    result = rollout(env, LQR(K), options={"state": x0}, trace_every=100)
    A, B = CartPendulum().linearise()
    exact = np.array([expm((A - B @ [K]) * t) @ x0 for t in result.traces.time])
    np.testing.assert_allclose(result.traces.x[:, :, 0], exact, atol=4e-7)


def test_decimated_traces_are_part_of_the_full_ones(closed_loop):
    full, part = closed_loop(2, trace_every=1).traces, closed_loop(2, trace_every=7).traces
    assert (part.time == full.time[::7]).all()
    assert (part.x == full.x[::7]).all()
    assert (part.u == full.u[::7]).all()
    assert closed_loop(2).traces is None


def test_an_estimate_that_diverges_fails_its_run_alone(make_vec):
    # spinning in the estimate alone, with a gain that cannot stop it: thetahat'' grows with its square
    observers = [SlidingModeObserver(xhat0=(0.0, 0.8, 0.0, 60.0)), SlidingModeObserver()]
    env = VectorObserverWrapper(make_vec(2, autoreset_mode="Disabled", horizon=2.1), observers)
    result = rollout(env, LQR(K), options={"state": np.array([[0.0, 0.8, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0]])})
    assert result.failed.tolist() == [True, False]
    assert np.isfinite([values[1] for values in result.metrics.values()]).all()
    assert result.metrics["duration"][0] < result.metrics["duration"][1] == pytest.approx(2.1)


def test_a_failed_run_is_held_and_the_others_go_on(closed_loop):
    states = np.array([[0.0, 0.5, 0.0, 0.0], [4.9, 0.0, 2.0, 0.0]])
    result = closed_loop(2, options={"state": states})
    assert result.failed.tolist() == [False, True]
    assert result.metrics["duration"].tolist() == [2.0, pytest.approx(0.06)]
    alone = closed_loop(1, options={"state": states[0], "params": None})
    for name, values in alone.metrics.items():
        assert values[0] == result.metrics[name][0]


def test_without_an_observer_there_is_no_estimation_error(closed_loop):
    class Still:
        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.zeros((len(observation), 1)), state

    result = closed_loop(2, Still(), observed=False)
    assert np.isnan(result.metrics["estimation_rms_h"]).all()
    assert np.isnan(result.metrics["peak_estimate_theta"]).all()
    assert (result.metrics["effort"] == 0.0).all()


def test_runs_do_not_depend_on_the_batch(closed_loop):
    small, large = (closed_loop(n, SlidingModeController((1, 2, 2, 1), 0.02, 5.0)) for n in (2, 150))
    assert_same(dict(small.metrics.items()), {k: v[:2] for k, v in large.metrics.items()})


def test_a_rollout_wants_one_episode_a_slot(make_vec):
    with pytest.raises(ValueError, match="autoreset_mode='Disabled'"):
        rollout(make_vec(1), LQR(K))
    with pytest.raises(ValueError, match="trace_every=0"):
        rollout(make_vec(1, autoreset_mode="Disabled"), LQR(K), trace_every=0)


SETTING = "{value: %s, source: chosen}"
SCENARIO = """
table: "4"
title: test
environment: SMOPendulum-v0
control_period: {value: 0.01, source: chosen}
horizon: {value: 1.0, source: chosen}
force_limit: {value: null, source: chosen}
track_limit: {value: null, source: chosen}
uncertainty: {value: [0.1, 0.2], source: chosen}
initial_states: {value: {"": [1.0, 1.0, 0.1, 0.01]}, source: chosen}
controllers:
  lqr:
    law: lqr
    K: {value: [7.234, -4.132, 11.075, -1.025], source: identified}
    observer:
      gains: {value: lqr, source: printed}
      slopes: {value: [12.0, 12.0], source: chosen}
      xhat0: {value: [0, 0, 0, 0], source: chosen}
"""


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SCENARIO)
    return scenario.load(path)


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


def test_more_runs_add_to_those_that_were_there():
    assert (study.deviations(3, 20)[:5] == study.deviations(3, 5)).all()
    assert (study.deviations(4, 5) != study.deviations(3, 5)).all()


def outcome(small, level, arm, values, failed=None):
    group = study.Group(small, "lqr", level, "", arm, len(values))
    values = np.array(values, dtype=float)
    metrics = dict.fromkeys(tables.NAMES, values)
    return study.Outcome(group, metrics, np.zeros(len(values), dtype=bool) if failed is None else np.array(failed))


def find(results, **where):
    (found,) = [r for r in results if all(getattr(r.cell, name) == value for name, value in where.items())]
    return found


def test_means_medians_reductions_and_averages(small):
    results = statistics.results(
        [
            outcome(small, 0.1, "without", [0.10, 0.12, 0.20]),
            outcome(small, 0.1, "with", [0.05, 0.03, 0.04]),
            outcome(small, 0.2, "without", [0.20, 0.22, 0.30]),
            outcome(small, 0.2, "with", [0.10, 0.08, 0.09]),
        ]
    )
    one = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
    assert (one.measured, one.median, one.runs, one.failures) == (pytest.approx(0.14), 0.12, 3, 0)
    assert one.ci_low < 0.14 < one.ci_high
    assert one.published == published()[Cell("4", "lqr", "10", "", "mse", "h", "without")]
    rms = find(results, uncertainty_percent="10", metric="rms", state="h", compensation="with")
    assert rms.measured == pytest.approx(np.sqrt(0.04))
    reduction = find(results, uncertainty_percent="20", metric="mse_reduction_percent", state="theta")
    assert reduction.measured == pytest.approx(100 * (1 - 0.09 / 0.24))
    assert reduction.ci_low < reduction.measured < reduction.ci_high
    average = find(results, uncertainty_percent="average", metric="mse", state="h", compensation="without")
    assert average.measured == pytest.approx((0.14 + 0.24) / 2)
    assert average.published == pytest.approx((0.1175 + 0.1178) / 2)
    of_averages = find(results, uncertainty_percent="average", metric="mse_reduction_percent", state="h")
    assert of_averages.measured == pytest.approx(100 * (1 - (0.04 + 0.09) / (0.14 + 0.24)))


def test_failed_runs_are_counted_and_kept_out_of_means(small):
    results = statistics.results(
        [
            outcome(small, 0.1, "without", [0.1, np.inf, 0.3, 0.2], [False, True, False, False]),
            outcome(small, 0.1, "with", [0.1, 0.1, 0.1, 99.0], [False, False, False, True]),
        ]
    )
    one = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
    assert (one.measured, one.failures, one.runs) == (pytest.approx(0.2), 1, 4)
    reduction = find(results, uncertainty_percent="10", metric="mse_reduction_percent", state="h")
    assert (reduction.runs, reduction.failures) == (4, 2)
    assert reduction.measured == pytest.approx(100 * (1 - (0.1 + 0.1) / (0.1 + 0.3)))  # over the pairs that are whole
    assert "2 of 8 runs failed" in tables.render(results, "simple", rms=False)
    nothing = statistics.results([outcome(small, 0.1, "with", [np.nan, np.nan], [True, True])])
    assert find(nothing, uncertainty_percent="10", metric="mse", state="h").failures == 2


def test_intervals_of_ten_runs_hold_the_mean_as_often_as_they_say(small):
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(400):
        without = rng.normal(1.0, 0.1, 10)
        both = [
            outcome(small, 0.1, "without", without),
            outcome(small, 0.1, "with", without * rng.normal(0.4, 0.04, 10)),
        ]
        results = statistics.results(both)
        mean = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
        reduction = find(results, uncertainty_percent="10", metric="mse_reduction_percent", state="h")
        held += np.array([mean.ci_low <= 1.0 <= mean.ci_high, reduction.ci_low <= 60.0 <= reduction.ci_high])
    assert (held > 0.92 * 400).all()
    assert (held < 0.98 * 400).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("horizon:", "horizn:"), r"horizn: unknown setting 'horizn': did you mean 'horizon'\?"),
        (("slopes:", "slope:"), r"slope: unknown setting 'slope': did you mean 'slopes'\?"),
        (("[0.1, 0.2]", "[0.1, 1.5]"), r"uncertainty\.value\.1: .* less than 1 \(given 1\.5\)"),
        (("source: printed", "source: guessed"), r"source: .*'printed', 'identified' or 'chosen' \(given 'guessed'\)"),
        (("law: lqr", "law: pid"), r"controllers\.lqr: Input tag 'pid' found using 'law' does not match"),
        (("SMOPendulum-v0", "SMOPendulm-v0"), "Environment `SMOPendulm` doesn't exist"),
        (("SMOPendulum-v0", "Pendulum-v1"), "Pendulum"),
        (("{value: 1.0,", "{value: -1.0,"), r"horizon=-1\.0 must be a finite number greater than 0"),
        (("gains: {value: lqr", "gains: {value: lqg"), r"unknown column of Table 3 'lqg': did you mean 'lqr'\?"),
        (("[12.0, 12.0]", "[1500, 12.0]"), "too large for these gains"),
        (('{"": [1.0, 1.0, 0.1, 0.01]}', "{}"), "initial_states.value: Dictionary should have at least 1 item"),
        (('table: "4"', "extends: bad.yaml"), "extends itself"),
        (('table: "4"', "extends: 5"), "extends=5 must be the name of a file"),
        (('table: "4"', ""), "table: Field required"),
        (("title: test", "title: ["), "is not YAML"),
    ],
)
def test_bad_scenarios_are_named(tmp_path, change, message):
    path = tmp_path / "bad.yaml"
    assert change[0] in SCENARIO
    path.write_text(SCENARIO.replace(*change))
    with pytest.raises(ValueError, match=message):
        scenario.load(path)


def test_a_scenario_of_the_upright_plant_is_upright(tmp_path):
    path = tmp_path / "upright.yaml"
    changes = (
        ("SMOPendulum-v0", "SMOPendulumUpright-v0"),
        ("[7.234, -4.132, 11.075, -1.025]", "[-3.16, -101.39, -7.16, -21.04]"),
    )
    text = SCENARIO.replace("[1.0, 1.0, 0.1, 0.01]", "[0.0, 0.1, 0.0, 0.0]")
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


def test_a_missing_scenario_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"none\.yaml: cannot be read \(No such file or directory\)"):
        scenario.load(tmp_path / "none.yaml")
