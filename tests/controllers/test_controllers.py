"""LQR against python-control, SMC against its equations, and Stable-Baselines3's way to call both."""

import math

import control
import gymnasium
import numpy as np
import pytest

from smo_gym import LQR, CartPendulum, ObserverWrapper, SlidingModeController

Q, R = [52.33, 57.61, 61.30, 0.39], 1.0


@pytest.mark.parametrize("model", [CartPendulum(), CartPendulum(gravity=9.8)])
def test_lqr_gain_is_that_of_python_control(model):
    expected, *_ = control.lqr(*model.linearise(), np.diag(Q), np.array([[R]]))
    np.testing.assert_allclose(LQR.design(Q, R, model).K, expected, rtol=1e-8)


def test_lqr_takes_full_weights():
    full = np.diag(Q) + 0.1
    expected, *_ = control.lqr(*CartPendulum().linearise(), full, np.array([[2.0]]))
    np.testing.assert_allclose(LQR.design(full, 2.0).K, expected, rtol=1e-8)


def test_lqr_is_minus_gain_times_estimate():
    K = np.array([1.0, -2.0, 3.0, -4.0])
    observation = np.random.default_rng(0).normal(size=(5, 6))
    action, state = LQR(K).predict(observation)
    np.testing.assert_allclose(action, -observation[:, 2:] @ K[:, None])
    assert state is None
    alone, _ = LQR(K).predict(observation[2])
    assert alone.shape == (1,)
    assert alone[0] == action[2, 0]


def test_lqr_may_have_a_gain_a_slot():
    K = np.random.default_rng(0).normal(size=(5, 4))
    observation = np.random.default_rng(1).normal(size=(5, 6))
    expected = -(observation[:, 2:] * K).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(LQR(K).predict(observation)[0], expected)


SMC = SlidingModeController((0.6, 1.5, 1.6, 0.4), 0.001, 3.0)


@pytest.mark.parametrize("law", [LQR([1.0, -2.0, 3.0, -4.0]), SMC])
def test_with_a_reference_the_laws_see_the_error(law):
    rng = np.random.default_rng(0)
    y, x_d, preview, xhat = (rng.normal(size=(7, n)) for n in (2, 4, 8, 4))
    tracking, _ = law.predict(np.concatenate([y, x_d, preview, xhat], axis=1))
    regulating, _ = law.predict(np.concatenate([y, xhat - x_d], axis=1))
    assert (tracking == regulating).all()


def smc_by_hand(estimates, k, dt, slope, Z0=26.0, lam=30.0, epsilon=0.1460):
    """Equations (49)-(50) in plain Python."""
    integral, forces = 0.0, []
    for h, theta, v, omega in estimates:
        s = 0.5 * (k[0] * h + k[2] * v) ** 2 + 0.5 * (k[1] * theta + k[3] * omega) ** 2
        switch = math.sin(math.pi / epsilon * (s + lam * integral))
        forces.append(Z0 * math.tanh(slope * switch))
        integral += dt * math.tanh(s)
    return forces


def test_smc_is_its_equations():
    k, dt, slope = (0.6, 1.5, 1.6, 0.4), 0.001, 3.0
    estimates = np.random.default_rng(0).normal(size=(50, 4))
    law, state, forces = SlidingModeController(k, dt, slope), None, []
    for estimate in estimates:
        action, state = law.predict(np.concatenate([[9.0, 9.0], estimate]), state)
        forces.append(action[0])
    np.testing.assert_allclose(forces, smc_by_hand(estimates, k, dt, slope), rtol=1e-10)


def test_smc_restarts_its_integral_slot_by_slot():
    law = SlidingModeController((0.6, 1.5, 1.6, 0.4), 0.001, 3.0)
    observation = np.ones((3, 6))
    _, state = law.predict(observation)
    before = state[0].copy()
    _, after = law.predict(observation, state, episode_start=np.array([False, True, False]))
    assert (state[0] == before).all()  # the state that was handed in is left alone
    assert after[0][1] == before[0]
    assert after[0][0] == after[0][2] == pytest.approx(2 * before[0])


def test_smc_with_exact_sgn_has_full_amplitude():
    law = SlidingModeController((0.6, 1.5, 1.6, 0.4), 0.001, math.inf)
    action, _ = law.predict(np.random.default_rng(0).normal(size=(20, 6)))
    assert set(np.abs(action[:, 0])) == {26.0}


@pytest.mark.parametrize("law", [LQR([7.2, -4.1, 11.1, -1.0]), SlidingModeController((0.6, 1.5, 1.6, 0.4), 0.02, 60.0)])
def test_stable_baselines3_evaluates_a_law(law):
    evaluate_policy = pytest.importorskip("stable_baselines3.common.evaluation").evaluate_policy
    from stable_baselines3.common.monitor import Monitor

    env = Monitor(ObserverWrapper(gymnasium.make("SMOPendulum-v0", horizon=1.0)))
    rewards, lengths = evaluate_policy(law, env, n_eval_episodes=3, return_episode_rewards=True)
    assert lengths == [50, 50, 50]
    assert np.isfinite(rewards).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LQR([1.0, 2.0]), r"K has shape \(2,\), it must have shape \(4,\) or \(n, 4\)"),
        (lambda: LQR([1.0, 2.0, np.nan, 0.0]), "K=.* must be finite"),
        (lambda: LQR.design([1, 1, 1, -1], 1.0), "Q=.* must be symmetric positive semidefinite"),
        (lambda: LQR.design(np.triu(np.ones((4, 4))), 1.0), "(?s)Q=.* must be symmetric positive semidefinite"),
        (lambda: LQR.design(Q, 0.0), r"R=0\.0 must be a finite number greater than 0"),
        (lambda: SlidingModeController((1, 1, 1, 0), 0.001, 1.0), "k=.* must be positive"),
        (lambda: SlidingModeController((1, 1, 1), 0.001, 1.0), r"k has shape \(3,\)"),
        (lambda: SlidingModeController((1, 1, 1, 1), 0.0, 1.0), "dt=0.0 must be a finite number greater than 0"),
        (
            lambda: SlidingModeController((1, 1, 1, 1), 0.001, -1.0),
            "slope=-1.0 must be positive, one number or one a slot",
        ),
        (lambda: LQR([1, 1, 1, 1]).predict(np.zeros((3, 2))), "wrap the environment in smo_gym.ObserverWrapper"),
        (lambda: LQR(np.ones((3, 4))).predict(np.zeros((5, 6))), "K has 3 slots, the observation has 5"),
        (lambda: LQR("abc"), "K has shape"),
        (lambda: LQR.design("abc", 1.0), "Q='abc' must be an array of numbers"),
        (
            lambda: SMC.predict(np.zeros((5, 6)), (np.zeros(2),)),
            r"state\[0\] has shape \(2,\), it must have shape \(5,\)",
        ),
    ],
)
def test_bad_settings_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("gravity", [-9.8, 9.8])
@pytest.mark.parametrize("Q", [[0, 1, 0, 1], [0, 1, 1, 1], [0, 0, 0, 0], [0, 0, 1, 0]])
def test_weights_that_stabilise_nothing_are_named(gravity, Q):
    with pytest.raises(ValueError, match=r"Q=\[0, .* without asymptotic stability"):
        LQR.design(Q, 1.0, CartPendulum(gravity=gravity))


@pytest.mark.parametrize("Q", [[1e-5, 0, 0, 0], [1, 1, 0, 0], [1e9, 1e9, 1e9, 1e9]])
def test_weights_that_stabilise_are_taken(Q):
    for gravity in (-9.8, 9.8):
        model = CartPendulum(gravity=gravity)
        A, B = model.linearise()
        assert np.linalg.eigvals(A - B @ LQR.design(Q, 1.0, model).K).real.max() < 0.0


def test_R_may_be_an_array_and_the_model_an_environment():
    upright = gymnasium.make("SMOPendulumUpright-v0")
    K = LQR.design(np.eye(4), [[1.0]], upright).K
    assert np.array_equal(K, LQR.design(np.eye(4), 1.0, CartPendulum(gravity=9.8)).K)
    assert np.array_equal(K, LQR.design(np.eye(4), 1.0, gymnasium.make_vec("SMOPendulumUpright-v0", 2)).K)
    with pytest.raises(ValueError, match="model='abc' must be a CartPendulum or a smo_gym environment"):
        LQR.design(np.eye(4), 1.0, "abc")
    with pytest.raises(ValueError, match=r"R=\[1.0, 2.0\] must be a positive number"):
        LQR.design(np.eye(4), [1.0, 2.0])


@pytest.mark.parametrize("turns", [-2, 1, 3])
def test_a_rod_that_has_turned_rests_where_it_is(turns):
    """The encoder counts on, the error does not; the article's laws, wrap=False, unwind the rod."""
    turned = np.array([0.0, 2 * np.pi * turns, 0.0, 2 * np.pi * turns, 0.0, 0.0])
    for law in (LQR([1.0, 2.0, 3.0, 4.0]), SlidingModeController([1.0, 2.0, 3.0, 4.0], 0.001, 30.0)):
        assert abs(law.predict(turned)[0][0]) < 1e-10
    assert LQR([1.0, 2.0, 3.0, 4.0], wrap=False).predict(turned)[0][0] == -4 * np.pi * turns


def test_within_half_a_turn_wrapping_changes_no_bit():
    observation = np.random.default_rng(0).uniform(-3.1, 3.1, (200, 6))
    for make in (
        lambda wrap: LQR([1.0, 2.0, 3.0, 4.0], wrap),
        lambda wrap: SlidingModeController([1, 2, 3, 4], 0.001, 30.0, wrap=wrap),
    ):
        assert np.array_equal(make(True).predict(observation)[0], make(False).predict(observation)[0])


def test_lists_are_taken_and_other_types_are_named():
    law = LQR([1.0, 2.0, 3.0, 4.0])
    assert np.array_equal(law.predict([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])[0], [-10.0])
    for bad in ("abc", None, [None] * 6, [10**400] * 6, [True] * 6, [[0.0], [1.0, 2.0]], np.zeros((1, 1, 6))):
        with pytest.raises(ValueError, match="observation=.* must be an array of numbers"):
            law.predict(bad)
