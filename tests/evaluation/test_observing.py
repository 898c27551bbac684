"""Observers on simulated encoders: same trajectories, errors by definition, the closed loop beside them."""

import gymnasium
import numpy as np
import pytest

from smo_gym import LQR
from smo_gym.evaluation import candidates, observing, robustness, study, velocity_errors
from smo_gym.evaluation.draws import deviations
from smo_gym.evaluation.open_loop import trajectories
from smo_gym.evaluation.report.observer_panels import front, neighbours
from smo_gym.evaluation.store import Store
from smo_gym.observers import Oracle, SlidingModeObserver
from smo_gym.wrappers import VectorObserverWrapper

K = LQR([7.197, -4.026, 10.96, -0.9999])
STATE = np.array([0.3, 0.2, 0.0, 0.0])
OPTIONS = {"control_period": 0.001, "horizon": 0.3}


def test_trajectories_are_those_of_the_environment():
    """The law on the true state, stepped through the vector environment, gives the same states to the bit."""
    seen = trajectories("SMOPendulum-v0", K, STATE, 0.2, 3, 7, **OPTIONS)
    env = gymnasium.make_vec("SMOPendulum-v0", 3, autoreset_mode="Disabled", **OPTIONS)
    observed = VectorObserverWrapper(env, Oracle())
    plants = [env.unwrapped.task.params.perturbed(0.2 * draw).as_array() for draw in deviations(7, 3)]
    observation, info = observed.reset(options={"state": np.tile(STATE, (3, 1)), "params": np.array(plants)})
    for k in range(300):
        assert (seen.x[k] == info["state"].T).all()
        action, _ = K.predict(observation)
        observation, *_, info = observed.step(action)
        assert (info["force"] == seen.u[k]).all()
    assert (seen.y == seen.x[:, :2]).all()


def test_an_estimate_is_that_of_the_observer_sample_by_sample():
    observer = SlidingModeObserver()
    sensor = {"noise": (2e-4, 1e-3)}
    seen = trajectories("SMOPendulum-v0", K, STATE, 0.0, 2, 7, sensor=sensor, **OPTIONS)
    xhat = seen.estimated(observer)
    estimator = observer.start(2, 1e-3, seen.force, seen.nominal)
    estimator.reset(np.ones(2, dtype=bool), seen.y[0])
    for k in range(1, len(seen.y)):
        estimator.update(seen.y[k][None].copy(), seen.u[k - 1])
    assert (estimator.xhat == xhat[-1]).all()
    assert (seen.y[:, :, 0] != seen.y[:, :, 1]).any()  # each run has noise of its own


def test_errors_by_their_definitions():
    dt, n = 0.01, 800
    t = dt * np.arange(n)
    x = np.stack([0 * t, 0 * t, np.sin(t), np.cos(2.0 * t)], 1)[:, :, None]
    late = 0.03
    xhat = np.stack([0 * t, 0 * t, np.sin(t - late), np.cos(2.0 * t) + 1.0 * (t < 0.5)], 1)[:, :, None]
    found = velocity_errors.errors(xhat, x, dt)
    assert found.lag[0, 0] == pytest.approx(late, rel=0.01)
    assert found.rmse[1, 0] == 0.0
    assert found.convergence[1, 0] == pytest.approx(0.5)
    assert found.convergence[0, 0] == 0.0  # 0.03 m/s at most, which is near
    mine = np.abs(np.diff(np.sin(t - late)[200:])).sum() / (dt * 599)
    assert found.total_variation[0, 0] == pytest.approx(mine)
    xhat[-1, 2] = np.nan
    assert np.isinf(velocity_errors.errors(xhat, x, dt).convergence[0, 0])


def test_the_front():
    assert front([(1.0, 5.0), (2.0, 2.0), (3.0, 3.0), (5.0, 1.0)]) == [True, True, False, True]


def test_rows_of_the_open_loop_are_kept(tmp_path):
    known = {"smo-tuned": candidates.named("simulated")["smo-tuned"]}
    given = (known, ["exact", "noise"], [0.1], 3, 0)
    told = []
    first = [*observing.open_loop(*given, Store(tmp_path), told.append)]
    assert len(first) == 4
    assert sum(told) == 2
    assert {row.channel for row in first} == {"h_dot", "theta_dot"}
    again = [*observing.open_loop(*given, Store(tmp_path))]
    assert repr(again) == repr(first)
    noisy = [row for row in first if row.sensor == "noise"]
    assert all(row.noise_gain > 0.0 and row.ci_low <= row.rmse <= row.ci_high for row in noisy)


def test_an_arm_of_the_closed_loop():
    wanted = observing.wanted(["smo-tuned"], ["counts"], [0.1], 2)
    with robustness.late_errors():
        (outcome,) = study.measure(wanted, 0)
    h, theta = observing.closed("counts", outcome)
    assert (h.loop, h.observer, h.runs, h.failed) == ("closed", "smo-tuned", 2, 0)
    errors = outcome.metrics["late_rms_theta_dot"]
    assert theta.rmse == pytest.approx(np.sqrt((errors**2).mean()))
    assert theta.effort == h.effort > 0.0


def test_pooled_errors():
    value, low, high = observing.pooled(np.array([1.0, 2.0, 2.0]))
    assert value == pytest.approx(np.sqrt(3.0))
    assert low < value < high
    assert np.isnan(observing.pooled(np.array([]))).all()


def test_points_that_are_near_share_a_label():
    points = {"a": (1.0, 10.0), "b": (2.0, 12.0), "c": (1.0, 100.0), "d": (50.0, 10.0)}
    assert sorted(map(sorted, neighbours(points, [*points]))) == [["a", "b"], ["c"], ["d"]]
