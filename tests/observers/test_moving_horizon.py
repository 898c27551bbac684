"""Moving horizon estimation: the Kalman filter on a linear model, the best fit to all samples on another one."""

import numpy as np
import pytest
from by_hand import DT, recording
from scipy.optimize import least_squares

from smo_gym import VectorObserverWrapper
from smo_gym.kernels import inlined
from smo_gym.kernels.elementary import sincos
from smo_gym.models import Model
from smo_gym.observers import ExtendedKalmanFilter, MovingHorizon
from smo_gym.plant import CartPendulum

T, Y, U, X = recording(60)
ACCELERATION, NOISE, VELOCITY = (0.3, 0.9), (1e-3, 2e-3), (0.5, 8.0)
SETTINGS = {"acceleration": ACCELERATION, "noise": NOISE, "velocity": VELOCITY}


@inlined
def _carts(x, s, inputs):
    return x[2], x[3], inputs[0], 0.5 * inputs[0]


@pytest.mark.parametrize("horizon", [1, 4])
def test_it_is_the_kalman_filter_where_all_is_linear(horizon):
    keep = np.r_[0:20, 23:60]
    mine, filtered = (
        observer.run(T[keep], Y[keep], U[keep])
        for observer in (
            MovingHorizon(horizon, **SETTINGS, model=Model(_carts)),
            ExtendedKalmanFilter(**SETTINGS, model=Model(_carts)),
        )
    )
    np.testing.assert_allclose(mine, filtered, rtol=0.0, atol=1e-8)


@inlined
def _swings(x, s, inputs):
    sin, _ = sincos(x[1])
    return x[2], x[3], inputs[0], 0.5 * inputs[0] - 60.0 * sin


def swings(x, u):
    return np.array([x[2], x[3], u, 0.5 * u - 60.0 * np.sin(x[1])])


def rk4(x, u, h):
    a = swings(x, u)
    b = swings(x + h / 2 * a, u)
    c = swings(x + h / 2 * b, u)
    d = swings(x + h * c, u)
    return x + h / 6 * (a + 2 * b + 2 * c + d)


def test_within_the_horizon_it_is_the_best_fit_to_all_samples():
    h, n, noise = 0.05, 12, (0.02, 0.1)
    settings = {**SETTINGS, "noise": noise}
    random = np.random.default_rng(3)
    u, x = random.normal(size=n), [np.array([0.0, 1.0, 0.3, 6.0])]
    for k in range(n - 1):
        x.append(rk4(x[k], u[k], h))
    y = np.array(x)[:, :2] + noise * random.normal(size=(n, 2))

    enters = np.array([[1.0, 0.0], [0.5, 1.0]]) @ np.diag(ACCELERATION)
    S = enters @ enters.T
    weight = np.linalg.inv(np.linalg.cholesky(np.block([[S * h**3 / 3, S * h**2 / 2], [S * h**2 / 2, S * h]])))

    def residuals(flat):
        states = flat.reshape(n, 4)
        first = (states[0] - [*y[0], 0.0, 0.0]) / [*noise, *VELOCITY]
        between = [weight @ (states[k + 1] - rk4(states[k], u[k], h)) for k in range(n - 1)]
        return np.concatenate([first, *between, ((states[1:, :2] - y[1:]) / noise).ravel()])

    best = least_squares(residuals, np.array(x).ravel(), xtol=1e-12, ftol=1e-12, gtol=1e-12).x.reshape(n, 4)[-1]
    model = Model(_swings)
    mine = MovingHorizon(n, **settings, model=model).run(h * np.arange(n), y, u)[-1]
    extended = ExtendedKalmanFilter(**settings, model=model).run(h * np.arange(n), y, u)[-1]
    np.testing.assert_allclose(mine, best, rtol=0.0, atol=1e-5)
    assert np.abs(extended - best).max() > 1e-3


def test_a_recording_and_sample_by_sample_are_the_same():
    observer = MovingHorizon(3)
    whole = observer.run(T[:20], Y[:20], U[:20])
    estimator = observer.start(2, DT, 10.0, CartPendulum())
    estimator.reset(np.ones(2, dtype=bool), np.tile(Y[0, :, None], 2))
    for k in range(1, 20):
        estimator.update(np.tile(Y[k, :, None], 2)[None], np.full(2, U[k - 1]))
        assert (estimator.xhat == whole[k][:, None]).all()


def test_what_is_not_finite_stays_in_its_slot_until_that_is_reset():
    estimator = MovingHorizon(3).start(2, DT, 10.0, CartPendulum())
    estimator.reset(np.ones(2, dtype=bool), np.tile(Y[0, :, None], 2))
    for _ in range(2):
        estimator.update(np.array([[[np.nan, 0.2], [0.1, 2.5]]]), np.zeros(2))
    assert np.isnan(estimator.xhat[:, 0]).all()
    assert np.isfinite(estimator.xhat[:, 1]).all()
    estimator.reset(np.array([True, False]), np.tile(Y[0, :, None], 2))
    estimator.update(Y[1, :, None][None].repeat(2, axis=2), np.zeros(2))
    assert np.isfinite(estimator.xhat).all()


def test_it_observes_an_environment(make_vec):
    env = VectorObserverWrapper(make_vec(2), "mhe", horizon=2)
    observation, _ = env.reset(seed=1)
    for _ in range(3):
        observation, *_ = env.step(env.action_space.sample())
    assert np.isfinite(observation).all()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"horizon": 0}, "horizon=0 must be a positive integer"),
        ({"acceleration": (1.0, 0.0)}, r"acceleration=\(1\.0, 0\.0\) must be two numbers greater than 0"),
    ],
)
def test_settings_that_cannot_be(settings, said):
    with pytest.raises(ValueError, match=said):
        MovingHorizon(**settings)
