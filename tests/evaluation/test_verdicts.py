"""Sentences of README and docs that rest on runs: what compensation costs, ceilings, rounding, falls."""

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from smo_gym import CartPendulum, VectorObserverWrapper
from smo_gym.evaluation import rollout, scenario, study, verdicts
from smo_gym.evaluation.statistics import place, results


@pytest.fixture(scope="module")
def regulation():
    """Table 4's LQR runs, six plants a level."""
    table4 = scenario.named("regulation")
    return study.measure(study.groups([table4], ["lqr"], ["without", "with"], 6), 0)


def test_the_ceiling_is_the_share_of_ten_run_means_near_the_true_one():
    rng = np.random.default_rng(0)
    values = rng.lognormal(0.0, 0.5, 4000)
    means = rng.lognormal(0.0, 0.5, (20_000, 10)).mean(axis=1)
    near = np.mean(np.abs(math.exp(0.125) / means - 1.0) <= 0.1)
    assert verdicts.ceiling(values) == pytest.approx(near, abs=0.03)
    assert verdicts.ceiling(np.ones(11)) == 1.0
    assert math.isnan(verdicts.ceiling(np.ones(10)))


def test_compensation_costs_ten_times_the_effort_and_makes_the_estimate_of_the_speed_worse(regulation):
    (line,) = verdicts.cost_lines(regulation)
    assert line.startswith(
        "Table 4, lqr: without and with compensation, effort 41 and 420 N^2 s, mean peak force 6.18 and"
    )
    assert line.endswith("worse with it in 36 of 36 runs.")


def test_most_of_the_gain_is_there_without_uncertainty(regulation):
    mse = {(o.group.uncertainty, o.group.arm): o.metrics["mse_h"].mean() for o in regulation}
    gains = {level: 1.0 - mse[level, "with"] / mse[level, "without"] for level, _ in mse}
    assert gains[0.0] > 0.64
    assert gains[0.0] > 0.99 * max(gains.values())


def runs(chosen, name, start, plants, xhat0=None):
    """MSEs and failures of a scenario's controller with compensation from one start on some plants."""
    observer = chosen.controllers[name].observer.build(compensation=True)
    observer = observer if xhat0 is None else replace(observer, xhat0=xhat0)
    env = gymnasium.make_vec(chosen.environment, len(plants), autoreset_mode="Disabled", **chosen.environment_options)
    options = {"state": np.tile(np.asarray(start, dtype=float), (len(plants), 1)), "params": plants}
    return rollout(VectorObserverWrapper(env, observer), chosen.agent(name), options=options)


@pytest.mark.slow
def test_falls_from_far_come_from_the_start_of_the_estimate():
    upright = scenario.named("upright")
    rng = np.random.default_rng(0)
    plants = np.array([CartPendulum(gravity=9.8).draw(0.2, rng).as_array() for _ in range(100)])
    start = [0.0, 0.4, 0.0, 0.0]
    assert runs(upright, "lqr", start, plants).failed.sum() == 18
    assert runs(upright, "lqr", start, plants, xhat0=tuple(start)).failed.sum() == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("regulation", 0.01), ("tracking", 0.03)])
def test_the_last_bit_of_the_start_moves_single_smc_runs(name, least):
    chosen = scenario.named(name)
    rng = np.random.default_rng(0)
    plants = np.array([CartPendulum().draw(0.2, rng).as_array() for _ in range(40)])
    (start,) = chosen.starts("smc").values()
    moved = [start[0] + 1e-15, *start[1:]]
    a, b = (runs(chosen, "smc", x0, plants).metrics for x0 in (start, moved))
    for metric in ("mse_h", "mse_theta"):
        print(name, metric, np.abs(b[metric] / a[metric] - 1.0).max(), b[metric].mean() / a[metric].mean() - 1.0)
    assert max(np.abs(b[m] / a[m] - 1.0).max() for m in ("mse_h", "mse_theta")) > least
    assert all(abs(b[m].mean() / a[m].mean() - 1.0) < 0.04 for m in ("mse_h", "mse_theta"))


@pytest.mark.slow
def test_table_7_scatters_more_than_ten_runs_explain():
    table7 = scenario.named("tracking")
    outcomes = study.measure(study.groups([table7], ["smc"], ["without", "with"], 200), 0)
    cells = [r for r in results(outcomes) if r.cell.metric == "mse" and not r.cell.is_average and r.published > 0.0]
    assert len(cells) == 24
    assert sum(abs(math.expm1(r.deviation)) <= 0.1 for r in cells) == 4
    assert sum(r.ceiling for r in cells) == pytest.approx(17.3, abs=0.1)
    runs_of = {(place(o)[0], o.group.arm): o.metrics for o in outcomes}
    rng, outside, spread = np.random.default_rng(0), 0, []
    for r in cells:
        values = runs_of[r.cell.uncertainty_percent, r.cell.compensation][f"mse_{r.cell.state}"]
        means = rng.choice(values, (20_000, 10)).mean(axis=1)
        outside += not means.min() <= r.published <= means.max()
        spread.append(means.std() / means.mean())
    assert outside == 5
    assert (min(spread), max(spread)) == pytest.approx((0.028, 0.188), abs=0.002)
