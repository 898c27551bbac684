"""Kalman's filters beside independent programs: filterpy, python-control, and by hand."""

import control
import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter as Theirs
from filterpy.kalman import KalmanFilter
from scipy.linalg import expm

from smo_gym.models import Model
from smo_gym.observers import ConstantAcceleration, ExtendedKalmanFilter, Luenberger, SteadyKalman
from smo_gym.observers.luenberger import C, discretised, linearised
from smo_gym.plant import CartPendulum

H = 0.01
NOISE, ACCELERATION, VELOCITY = (2e-4, 1e-3), (0.3, 1.2), (0.7, 2.0)
MODEL = Model.of(CartPendulum())


def flow(x, u, h=H):
    a = MODEL.rate(x, u)
    b = MODEL.rate(x + 0.5 * h * a, u)
    c = MODEL.rate(x + 0.5 * h * b, u)
    return x + h / 6.0 * (a + 2.0 * (b + c) + MODEL.rate(x + h * c, u))


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(0)
    n = 1001
    u = 3.0 * np.sin(2.0 * H * np.arange(n))
    x = np.empty((n, 4))
    x[0] = 0.1, 0.6, 0.0, 0.0
    for k in range(n - 1):
        x[k + 1] = flow(x[k], u[k])
    return H * np.arange(n), x, x[:, :2] + rng.normal(size=(n, 2)) * NOISE, u


def halfway(x, u, h):
    """F and Q from the model's Jacobian halfway, written again with NumPy's matrices."""
    new = flow(x, u, h)
    middle = 0.5 * (x + new)
    A, step = np.zeros((4, 4)), 2.0**-17
    for j in range(4):
        d = step * np.eye(4)[j]
        A[:, j] = (MODEL.rate(middle + d, u) - MODEL.rate(middle - d, u)) / (2.0 * step)
    A[:2] = np.eye(2, 4, k=2)
    B = (MODEL.rate(middle, u + step) - MODEL.rate(middle, u - step)) / (2.0 * step)
    r, q = B[3] / B[2], np.square(ACCELERATION)
    power = np.array([[q[0], r * q[0]], [r * q[0], r * r * q[0] + q[1]]])
    Q = np.block([[power * h**3 / 3.0, power * h**2 / 2.0], [power * h**2 / 2.0, power * h]])
    return new, np.eye(4) + h * A + 0.5 * h * h * A @ A, Q


def test_a_thousand_steps_of_filterpys(recording):
    t, _, y, u = recording
    ours = ExtendedKalmanFilter(ACCELERATION, NOISE, VELOCITY).run(t, y, u)
    theirs = Theirs(dim_x=4, dim_z=2)
    theirs.x, theirs.R = np.array([*y[0], 0.0, 0.0]), np.diag(np.square(NOISE))
    theirs.P = np.diag(np.square([*NOISE, *VELOCITY]))
    for k in range(1, len(t)):
        theirs.x, F, Q = halfway(theirs.x, u[k - 1], H)
        theirs.P = F @ theirs.P @ F.T + Q
        theirs.update(y[k], lambda x: np.eye(2, 4), lambda x: x[:2])
        assert ours[k] == pytest.approx(theirs.x, rel=0.0, abs=1e-10)


def test_it_is_better_than_its_parts_and_consistent(recording):
    t, x, y, u = recording
    e = ExtendedKalmanFilter((0.01, 0.01), NOISE, VELOCITY).run(t, y, u) - x
    assert (np.sqrt((e[300:, :2] ** 2).mean(0)) < 0.6 * np.array(NOISE)).all()
    assert np.sqrt((e[300:, 2:] ** 2).mean(0)).max() < 0.01


def test_a_saturated_innovation_is_a_tanh(recording):
    """One sample that is off by a radian moves angle and speed alike, by what b tanh(e / b) of it does."""
    t, _, y, u = recording
    off = y.copy()
    off[500, 1] += 1.0
    plain, bounded = (ExtendedKalmanFilter(ACCELERATION, NOISE, saturation=s) for s in ((None, None), (None, 4.0)))
    jumps = [np.abs(o.run(t, off, u)[500] - o.run(t, y, u)[500]) for o in (plain, bounded)]
    assert jumps[0][3] > 10.0
    assert jumps[1][3] < 0.02 * jumps[0][3]
    ratio = jumps[1] / jumps[0]
    assert ratio[3] == pytest.approx(ratio[1], rel=1e-4)  # the same innovation, bounded
    close = [o.run(t, y, u) for o in (plain, ExtendedKalmanFilter(ACCELERATION, NOISE, saturation=(1e6, 1e6)))]
    assert close[0] == pytest.approx(close[1], rel=0.0, abs=1e-9)


def test_adaptation_follows_a_wrong_model_and_leaves_a_right_one(recording):
    t, x, y, u = recording
    wrong = CartPendulum(rod_length=0.6)
    small = (0.05, 0.05)

    def error(adaptation, model):
        found = ExtendedKalmanFilter(small, NOISE, saturation=(None, 4.0), adaptation=adaptation).run(
            t, y, u, model=model
        )
        return np.sqrt(((found - x)[300:, 3] ** 2).mean())

    assert error(0.05, wrong) < 0.5 * error(0.0, wrong)
    assert error(0.05, CartPendulum()) < 1.3 * error(0.0, CartPendulum())


def test_constant_acceleration_is_filterpys(recording):
    t, _, y, u = recording
    keep = np.delete(np.arange(len(t)), [300, 301, 700])
    jerk, velocity, acceleration = (20.0, 90.0), (1.0, 3.0), (5.0, 30.0)
    ours = ConstantAcceleration(jerk, NOISE, velocity, acceleration).run(t[keep], y[keep], u[keep])
    for c in (0, 1):
        theirs = KalmanFilter(dim_x=3, dim_z=1)
        theirs.x, theirs.H = np.array([[y[0, c]], [0.0], [0.0]]), np.array([[1.0, 0.0, 0.0]])
        theirs.P, theirs.R = np.diag(np.square([NOISE[c], velocity[c], acceleration[c]])), np.array([[NOISE[c] ** 2]])
        for k in range(1, len(keep)):
            h = round((t[keep[k]] - t[keep[k - 1]]) / H) * H
            theirs.F = np.array([[1.0, h, h * h / 2.0], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
            powers = [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
            theirs.Q = jerk[c] ** 2 * np.array(powers)
            theirs.predict()
            theirs.update(y[keep[k], c])
            assert ours[k, [c, 2 + c]] == pytest.approx(theirs.x[:2, 0], rel=0.0, abs=1e-9)


@pytest.mark.parametrize("about", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 1.0)])
def test_constant_gains_are_python_controls(about):
    observer = SteadyKalman(ACCELERATION, NOISE, about)
    A, B = linearised(MODEL, np.array(about))
    G = np.zeros((4, 2))
    G[2:] = [[ACCELERATION[0], 0.0], [ACCELERATION[0] * B[3] / B[2], ACCELERATION[1]]]
    F, Q = discretised(A, G, H)
    predictor, _, _ = control.dlqe(F, np.eye(4), C, Q, np.diag(np.square(NOISE)))
    assert F @ observer.gains(MODEL, H) == pytest.approx(predictor, rel=1e-9, abs=1e-9)


def test_the_covariance_over_a_period_is_the_integral():
    A = linearised(MODEL, np.array([0.0, 0.3, 0.0, 0.5]))[0]
    G = np.array([[0.0, 0.0], [0.0, 0.0], [0.3, 0.0], [0.1, 0.7]])
    F, Q = discretised(A, G, 0.05)
    s, w = np.polynomial.legendre.leggauss(12)
    parts = [expm(A * 0.025 * (1.0 + each)) @ G for each in s]
    assert pytest.approx(sum(0.025 * b * p @ p.T for b, p in zip(w, parts, strict=True)), rel=1e-10, abs=1e-15) == Q
    assert pytest.approx(expm(0.05 * A), rel=1e-12) == F


def test_the_long_run_of_the_filter_is_the_constant_gain():
    """At rest, where the linearisation is the model's, for two double integrators in particular."""
    t = H * np.arange(4000)
    y = np.zeros((4000, 2))
    y[3000:] = 1e-4
    u = np.zeros(4000)
    slow = ExtendedKalmanFilter(ACCELERATION, NOISE).run(t, y, u)
    constant = SteadyKalman(ACCELERATION, NOISE, (0.0,) * 4).run(t, y, u)
    assert constant[3000:3100] == pytest.approx(slow[3000:3100], rel=0.0, abs=2e-6)


def test_poles_are_where_they_are_wanted():
    observer = Luenberger((30.0, 50.0))
    F = discretised(linearised(MODEL, np.zeros(4))[0], np.zeros((4, 1)), H)[0]
    K = observer.gains(MODEL, H)
    poles = np.sort(np.linalg.eigvals(F - K @ C @ F).real)
    wanted = np.exp(-H * np.array([30.0, 31.5, 55.0, 57.5]))
    assert poles == pytest.approx(np.sort(wanted), rel=1e-6)


@pytest.mark.parametrize(
    "observer",
    [
        ExtendedKalmanFilter(saturation=(5.0, 4.0), adaptation=0.05, substeps=2),
        ConstantAcceleration(),
        SteadyKalman(),
        Luenberger(),
    ],
    ids=repr,
)
def test_a_recording_and_sample_by_sample_are_the_same(recording, observer):
    t, _, y, u = recording
    whole = observer.run(t[:60], y[:60], u[:60])
    estimator = observer.start(2, H, 3.0, CartPendulum())
    estimator.reset(np.ones(2, dtype=bool), np.tile(y[0, :, None], 2))
    for k in range(1, 60):
        estimator.update(np.tile(y[k, :, None], 2)[None], np.full(2, u[k - 1]))
        assert (estimator.xhat == whole[k][:, None]).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ExtendedKalmanFilter(noise=(0.0, 1.0)), "noise"),
        (lambda: ExtendedKalmanFilter(saturation=3.0), "saturation"),
        (lambda: ExtendedKalmanFilter(adaptation=-0.1), "adaptation"),
        (lambda: ExtendedKalmanFilter(substeps=0), "substeps"),
        (lambda: ConstantAcceleration(jerk=(1.0,)), "jerk"),
        (lambda: SteadyKalman(acceleration=(1.0, -1.0)), "acceleration"),
        (lambda: Luenberger(rate=(np.inf, 1.0)), "rate"),
    ],
)
def test_settings_that_cannot_be(make, said):
    with pytest.raises(ValueError, match=said):
        make()
