"""The observer against samples computed by hand, its theorem, and its refusals."""

import itertools
import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from smo_gym import LQR, CartPendulum, Gains, ObserverWrapper, SlidingModeObserver
from smo_gym.observers import start_each

DT = 0.001


def accelerations(x, u, M_c=3.5, m=0.32, l=0.44, g=-9.8):
    """Equations (1)-(2) as printed."""
    _, theta, _, omega = x
    sin, cos = math.sin(theta), math.cos(theta)
    h = (u - m * g * cos * sin + m * l * omega**2 * sin) / (M_c + m * sin**2)
    t = ((M_c + m) * g * sin - u * cos - m * l * omega**2 * sin * cos) / (M_c * l + m * l * sin**2)
    return h, t


def by_hand(xhat, y0, y1, u, gains, slopes, compensation, dt, psi=None):
    """One RK4 step of (34)-(35) in plain Python; ``psi`` is a held psi2, None for the injection itself."""
    m1, beta_1, beta_2 = gains.m1, gains.beta_1, gains.beta_2

    def rhs(x, s):
        y = [a + s * (b - a) for a, b in zip(y0, y1, strict=True)]
        injection = [m1[i] * math.tanh(slopes[0] * (y[i] - x[i])) for i in (0, 1)]
        target = injection if psi is None else psi
        acceleration = accelerations(x, u)
        m2 = [beta_1[i] + compensation * beta_2[i] * abs(u) for i in (0, 1)]
        return np.array(
            injection + [m2[i] * math.tanh(slopes[1] * (target[i] - x[2 + i])) + acceleration[i] for i in (0, 1)]
        )

    x = np.array(xhat, dtype=float)
    a = rhs(x, 0.0)
    b = rhs(x + dt / 2 * a, 0.5)
    c = rhs(x + dt / 2 * b, 0.5)
    d = rhs(x + dt * c, 1.0)
    return x + dt / 6 * (a + 2 * b + 2 * c + d)


SAMPLES = np.array([[0.31, -0.82], [0.312, -0.817], [0.315, -0.812], [0.319, -0.806]])


def update(observer, u, samples=SAMPLES, xhat0=None):
    """xhat after a period of as many samples as follow the first."""
    estimator = (replace(observer, xhat0=xhat0) if xhat0 is not None else observer).start(1, DT, 30.0, CartPendulum())
    estimator.reset(np.array([True]), samples[0][:, None])
    estimator.update(samples[1:, :, None], np.array([u]))
    return estimator.xhat[:, 0]


@pytest.mark.parametrize("column", ["lqr", "smc"])
@pytest.mark.parametrize("compensation", [True, False])
def test_samples_computed_by_hand(column, compensation):
    xhat0, u = (0.1, -0.5, 0.2, 0.4), -7.0
    observer = SlidingModeObserver(gains=column, compensation=compensation, slopes=(12.3, 17.0))
    expected = np.array(xhat0)
    for y0, y1 in itertools.pairwise(SAMPLES):
        expected = by_hand(expected, y0, y1, u, Gains.of(column), (12.3, 17.0), compensation, DT)
    np.testing.assert_allclose(update(observer, u, xhat0=xhat0), expected, rtol=1e-13, atol=1e-15)


def test_its_own_step_divides_the_sampling_period():
    gains = Gains((2.0, 2.0), (1.0, 2.0), (0.3, 0.4))
    observer = SlidingModeObserver(gains=gains, slopes=(12.0, 15.0), step=DT / 4)
    expected = np.zeros(4)
    for y0, y1 in itertools.pairwise(SAMPLES):
        for j in range(4):
            a, b = (y0 + s / 4 * (y1 - y0) for s in (j, j + 1))
            expected = by_hand(expected, a, b, 9.0, gains, (12.0, 15.0), True, DT / 4)
    np.testing.assert_allclose(update(observer, 9.0), expected, rtol=1e-12, atol=1e-15)


def test_low_pass_filters_the_mean_injection_of_each_step():
    gains, tau = Gains.of("lqr"), 0.004
    observer = SlidingModeObserver(gains=gains, slopes=(12.0, 15.0), time_constant=tau)
    expected, psi = np.zeros(4), np.zeros(2)
    for y0, y1 in itertools.pairwise(SAMPLES):
        after = by_hand(expected, y0, y1, 3.0, gains, (12.0, 15.0), True, DT, psi=psi)
        psi = psi + (1 - math.exp(-DT / tau)) * ((after[:2] - expected[:2]) / DT - psi)
        expected = after
    np.testing.assert_allclose(update(observer, 3.0), expected, rtol=1e-12, atol=1e-15)


def test_exact_sgn_moves_the_position_estimate_at_full_speed():
    observer = SlidingModeObserver(slopes=(math.inf, 12.0), time_constant=0.01)
    estimate = update(observer, 0.0)
    np.testing.assert_allclose(estimate[:2], [3 * DT * 2.0, -3 * DT * 2.0], rtol=1e-12)


def test_compensation_is_the_part_of_the_gain_in_the_force():
    with_, without = (SlidingModeObserver(compensation=c) for c in (True, False))
    assert (update(with_, 0.0) == update(without, 0.0)).all()
    assert (update(with_, 10.0) != update(without, 10.0)).any()


def test_each_slot_may_have_its_own_settings():
    observers = [SlidingModeObserver(compensation=c, slopes=(s, s)) for c in (True, False) for s in (10.0, 14.0)]
    observers += [SlidingModeObserver(step=DT / 2), SlidingModeObserver(model=CartPendulum(4.0))]
    n = len(observers)
    bank = start_each(observers, DT, 30.0, CartPendulum())
    bank.reset(np.ones(n, dtype=np.bool_), np.repeat(SAMPLES[0][:, None], n, axis=1))
    bank.update(np.repeat(SAMPLES[1:, :, None], n, axis=2), np.full(n, 5.0))
    for i, observer in enumerate(observers):
        assert (bank.xhat[:, i] == update(observer, 5.0)).all()


def closed_loop(observer, x0, duration, dt):
    """True states and estimates at every sample, and forces, of an LQR run on a plant that is 10 % off."""
    env = gymnasium.make(
        "SMOPendulum-v0",
        control_period=dt,
        dt=dt,
        horizon=duration,
        force_limit=None,
        track_limit=None,
        uncertainty=0.0,
    )
    env = ObserverWrapper(env, observer)
    plant = CartPendulum().perturbed([0.1, -0.1, 0.1])
    agent = LQR([7.234, -4.132, 11.075, -1.025])
    observation, info = env.reset(options={"state": x0, "params": plant})
    x, xhat, u = [info["state"]], [observation[2:]], []
    over = False
    while not over:
        action, _ = agent.predict(observation)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
        x.append(info["state"])
        xhat.append(observation[2:])
        u.append(info["force"])
    return plant, np.array(x).T, np.array(xhat).T, np.array(u)


def required_betas(plant, x, xhat, u):
    """The suprema on the right of (30) and (31) along a trajectory, row by row."""
    nominal = CartPendulum()
    drift = np.abs(plant.drift(x) - nominal.drift(xhat))[2:]
    gain = np.abs(plant.gain(x) - nominal.gain(xhat))[2:]
    return drift.max(axis=1), gain.max(axis=1)


X0 = [0.5, 0.6, 0.1, 0.01]


def test_position_error_is_in_its_layer_after_the_time_of_equation_43():
    k = 60.0
    gains = Gains((5.0, 5.0), (30.0, 30.0), (1.5, 1.5))
    observer = SlidingModeObserver(gains=gains, slopes=(k, 20.0), step=0.0005)
    plant, x, xhat, u = closed_loop(observer, X0, 4.0, DT)
    speed = np.abs(x[2:]).max(axis=1)
    drift, gain = required_betas(plant, x, xhat, u)
    assert (speed < 5.0).all()  # (28)
    assert drift.max() < 30.0  # (30)
    assert gain.max() < 1.5  # (31)
    time = DT * np.arange(x.shape[1])
    for i in (0, 1):
        t0 = abs(x[i, 0]) / (5.0 - speed[i])  # (43) with kappa_1 = m1 - sup|X2|
        layer = math.atanh(speed[i] / 5.0) / k
        error = np.abs(x[i] - xhat[i])
        assert error[0] > layer
        assert error[time >= t0].max() <= layer


def test_all_errors_are_small_after_the_time_of_equation_48_with_exact_sgn():
    dt, tau, m1, beta_1, beta_2 = 1e-4, 0.003, 5.0, 40.0, 1.5
    gains = Gains((m1, m1), (beta_1, beta_1), (beta_2, beta_2))
    observer = SlidingModeObserver(gains=gains, slopes=(math.inf, math.inf), time_constant=tau)
    plant, x, xhat, u = closed_loop(observer, X0, 3.0, dt)
    speed = np.abs(x[2:]).max(axis=1)
    drift, gain = required_betas(plant, x, xhat, u)
    assert (speed < m1).all()
    assert drift.max() < beta_1
    assert gain.max() < beta_2
    acceleration = np.abs(np.diff(x[2:], axis=1)).max(axis=1) / dt
    time = dt * np.arange(x.shape[1])
    for i in (0, 1):
        t0 = abs(x[i, 0]) / (m1 - speed[i])
        at_t0 = round(t0 / dt) + 1
        # (48); the low-pass needs a few time constants more to forget the reaching phase
        t1 = t0 + abs(x[2 + i, at_t0] - xhat[2 + i, at_t0]) / (beta_1 - drift[i]) + 8 * tau
        position, velocity = (np.abs(x[j] - xhat[j])[time >= t1].max() for j in (i, 2 + i))
        # sgn chatters by one step; the low-pass lags by tau and lets a ripple of m1 dt / tau through
        assert position <= 2 * m1 * dt
        assert velocity <= tau * acceleration[i] + 2 * m1 * dt / tau + 2 * (beta_1 + beta_2 * np.abs(u).max()) * dt


def test_a_step_too_large_is_refused_with_the_largest_that_works():
    steep = SlidingModeObserver(gains=Gains((6.0, 6.0), (30.0, 30.0), (0.5, 0.5)), slopes=(100.0, 100.0))
    with pytest.raises(ValueError, match=r"step=0\.001 s is too large .* step=0\.0005$"):
        steep.start(1, DT, 30.0, CartPendulum())
    replace(steep, step=0.0005).start(1, DT, 30.0, CartPendulum())
    with pytest.raises(ValueError, match=r"RK4 is stable up to 0\.0006189 s"):
        replace(steep, step=DT / 1).start(1, DT, 30.0, CartPendulum())


def test_the_limit_of_the_step_is_where_the_error_starts_to_grow():
    gains = Gains((2.0, 2.0), (0.0, 0.0), (0.0, 0.0))
    largest = SlidingModeObserver(gains=gains).largest_step(30.0)

    def error_after(dt):
        observer = SlidingModeObserver(gains=gains, xhat0=(1e-9, 0.0, 0.0, 0.0))
        x = np.array(observer.xhat0)
        for _ in range(40):
            x = by_hand(x, (0.0, 0.0), (0.0, 0.0), 0.0, gains, (12.0, 12.0), True, dt)
        return abs(x[0])

    assert error_after(0.99 * largest) < 1e-9 < error_after(1.01 * largest)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gains": "lqg"}, r"unknown column of Table 3 'lqg': did you mean 'lqr'\?"),
        ({"gains": {"m1": (1, 1), "beta1": (1, 1)}}, r"unknown observer gain 'beta1': did you mean 'beta_1'\?"),
        ({"gains": {"m1": (0, 1), "beta_1": (1, 1), "beta_2": (0, 0)}}, "m1=.* must be positive"),
        ({"gains": {"m1": (1, 1), "beta_1": (-1, 1), "beta_2": (0, 0)}}, "beta_1=.* must be at least 0"),
        ({"slopes": (0.0, 1.0)}, "slopes=.* must be two positive numbers"),
        ({"slopes": (math.inf, 1.0)}, "needs a time_constant greater than 0"),
        ({"time_constant": -1.0}, r"time_constant=-1\.0 must be at least 0"),
        ({"step": 0.0}, r"step=0\.0 must be a finite number greater than 0"),
        ({"xhat0": (0.0, 1.0)}, r"xhat0 has shape \(2,\), it must have shape \(4,\)"),
        ({"compensation": "on"}, "compensation='on' must be True or False"),
    ],
)
def test_bad_settings_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        SlidingModeObserver(**settings)


def test_the_step_divides_the_sampling_period():
    with pytest.raises(ValueError, match="must be a whole multiple of step=0.0003"):
        SlidingModeObserver(step=0.0003).start(1, DT, 30.0, CartPendulum())
