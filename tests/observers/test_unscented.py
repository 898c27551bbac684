"""The unscented Kalman filter beside filterpy's with van der Merwe's points."""

import numpy as np
import pytest
from by_hand import DT, process_noise, recording, rk4
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as Filterpy

from smo_gym.observers import ExtendedKalmanFilter, UnscentedKalmanFilter
from smo_gym.plant import CartPendulum

ACCELERATION, NOISE, VELOCITY = (0.3, 0.9), (2e-4, 1e-3), (0.5, 2.0)
SETTINGS = {"acceleration": ACCELERATION, "noise": NOISE, "velocity": VELOCITY}
T, Y, U, X = recording()


def by_filterpy(t, y, u, alpha=1.0, beta=2.0, kappa=0.0, substeps=1):
    points = MerweScaledSigmaPoints(4, alpha, beta, kappa)
    oracle = Filterpy(4, 2, DT, hx=lambda x: x[:2], fx=None, points=points)
    oracle.x, oracle.P = np.array([*y[0], 0.0, 0.0]), np.diag(np.square([*NOISE, *VELOCITY]))
    oracle.Q, oracle.R = np.zeros((4, 4)), np.diag(np.square(NOISE))
    xhat = [oracle.x]
    for k in range(1, len(t)):
        h = t[k] - t[k - 1]
        steps = int(np.ceil(substeps * h / DT - 1e-6))
        for _ in range(steps):
            before = oracle.x
            oracle.predict(h / steps, fx=lambda x, dt, k=k: rk4(x, u[k - 1], dt))
            # the direction of the noise is known now, and filterpy's points for the measurement are drawn after it
            oracle.P = oracle.P + process_noise((before + oracle.x) / 2, u[k - 1], ACCELERATION, h / steps)
            oracle.sigmas_f = points.sigma_points(oracle.x, oracle.P)
        oracle.update(y[k])
        xhat.append(oracle.x)
    return np.array(xhat)


@pytest.mark.parametrize("points", [{}, {"alpha": 0.3, "beta": 1.0, "kappa": -1.0}, {"substeps": 3}])
def test_it_is_filterpys(points):
    xhat = UnscentedKalmanFilter(**SETTINGS, **points).run(T, Y, U)
    np.testing.assert_allclose(xhat, by_filterpy(T, Y, U, **points), rtol=0.0, atol=1e-10)


def test_gaps_are_bridged_with_the_time_that_passed():
    keep = np.r_[0:50, 51:53, 60:200]
    xhat = UnscentedKalmanFilter(**SETTINGS).run(T[keep], Y[keep], U[keep])
    np.testing.assert_allclose(xhat, by_filterpy(T[keep], Y[keep], U[keep]), rtol=0.0, atol=1e-10)


def test_points_close_by_see_what_the_jacobian_sees():
    near, far = (UnscentedKalmanFilter(**SETTINGS, alpha=alpha).run(T, Y, U)[200:] for alpha in (1e-3, 1.0))
    extended = ExtendedKalmanFilter(**SETTINGS).run(T, Y, U)[200:]
    assert np.abs(near - extended).max() < 2e-3
    for xhat in (near, far):
        assert np.sqrt(np.mean((xhat - X[200:])[:, 3] ** 2)) < 0.06


def test_a_recording_and_sample_by_sample_are_the_same():
    observer = UnscentedKalmanFilter()
    whole = observer.run(T[:200], Y[:200], U[:200])
    estimator = observer.start(3, DT, 10.0, CartPendulum())
    estimator.reset(np.ones(3, dtype=bool), np.tile(Y[0, :, None], 3))
    for k in range(1, 200):
        estimator.update(np.tile(Y[k, :, None], 3)[None], np.full(3, U[k - 1]))
        assert (estimator.xhat == whole[k][:, None]).all()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"acceleration": (1.0, 0.0)}, r"acceleration=\(1\.0, 0\.0\) must be two numbers greater than 0"),
        ({"alpha": 0.0}, r"alpha=0\.0 must be a finite number greater than 0"),
        ({"kappa": -4.0}, r"kappa=-4\.0 must be a finite number greater than -4"),
        ({"beta": 0.5}, r"beta=0\.5 must be at least alpha\^2=1"),
        ({"substeps": 0}, "substeps=0 must be a positive integer"),
    ],
)
def test_settings_that_cannot_be(settings, said):
    with pytest.raises(ValueError, match=said):
        UnscentedKalmanFilter(**settings)
