"""Rollouts and their metrics: against plain loops, and whatever else is in the batch."""

import gymnasium
import numpy as np
import pytest
from conftest import assert_same
from scipy.linalg import expm

import smo_gym
from smo_gym import LQR, CartPendulum, SlidingModeController, SlidingModeObserver, VectorObserverWrapper
from smo_gym.evaluation import rollout

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


def test_gymnasiums_own_batch_is_refused_by_name():
    env = gymnasium.make_vec("SMOPendulum-v0", 2, vectorization_mode="sync")
    for each in (env, VectorObserverWrapper(env)):
        with pytest.raises(TypeError, match=r"is a SyncVectorEnv, .* make it by gymnasium\.make_vec\(\.\.\., vectoriz"):
            rollout(each, LQR(K))
