"""Observers on recordings: of any plant, uneven, and the same to the bit sample by sample."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from smo_gym.kernels import inlined
from smo_gym.models import Model
from smo_gym.observers import OBSERVERS, SlidingModeObserver
from smo_gym.plant import CartPendulum

DT = 1e-3


def recording(n=400, model=None, dt=DT):
    model = model or Model.of(CartPendulum())
    t = dt * np.arange(n)
    u = np.sin(3.0 * t)
    x = np.empty((n, 4))
    x[0] = 0.05, 0.3, 0.0, 0.0
    for k in range(n - 1):
        x[k + 1] = solve_ivp(lambda s, z, k=k: model.rate(z, u[k]), (0.0, dt), x[k], rtol=1e-8).y[:, -1]
    return t, x, u


@inlined
def _two_springs(x, s, inputs):
    q1, q2, v1, v2 = x
    u, stiff, damping = inputs
    return v1, v2, -stiff * q1 + u, -0.5 * stiff * q2 - damping * v2


SPRINGS = Model(_two_springs, (40.0, 0.3), ("x", "y"))


@pytest.mark.parametrize("settings", [{}, {"scheme": "implicit"}, {"injection": "26", "measurement": "new"}])
def test_a_recording_and_sample_by_sample_are_the_same(settings):
    t, x, u = recording(200)
    observer = SlidingModeObserver(**settings)
    whole = observer.run(t, x[:, :2], u, force=1.0)
    estimator = observer.start(3, DT, 1.0, CartPendulum())
    estimator.reset(np.ones(3, dtype=bool), np.tile(x[0, :2, None], 3))
    for k in range(1, len(t)):
        estimator.update(np.tile(x[k, :2, None], 3)[None], np.full(3, u[k - 1]))
        assert (estimator.xhat == whole[k][:, None]).all()


def test_a_gap_is_bridged_with_the_time_that_passed():
    t, x, u = recording(200)
    keep = np.r_[0:100, 101:103, 106:200]
    u = np.full_like(u, 0.7)  # so that what acted in the gap is known
    observer = SlidingModeObserver(xhat0="measured")
    gappy = observer.run(t[keep], x[keep, :2], u[keep])
    estimator = observer.start(1, DT, 0.7, CartPendulum())
    estimator.reset(np.ones(1, dtype=bool), x[0, :2, None])
    times = t[keep]
    for k in range(1, len(keep)):
        elapsed = None if keep[k] == keep[k - 1] + 1 else times[k] - times[k - 1]  # None is as told at the start
        estimator.update(x[keep[k], :2, None][None], u[:1], elapsed=elapsed)
        assert (estimator.xhat[:, 0] == gappy[k]).all()
    # the measurement lies on the line between two samples: a gap is as if the samples on that line had been there
    filled = np.array([np.interp(t, times, x[keep, c]) for c in (0, 1)]).T
    assert np.allclose(observer.run(t, filled, u)[-1], gappy[-1], rtol=0.0, atol=1e-9)


def test_a_plant_of_ones_own():
    t, x, u = recording(3000, SPRINGS)
    observer = SlidingModeObserver(
        {"m1": (3.0, 3.0), "beta_1": (4.0, 4.0), "beta_2": (0.0, 0.0)}, slopes=(100.0, 50.0), model=SPRINGS
    )
    xhat = observer.run(t, x[:, :2], u)
    assert np.abs(xhat - x)[2000:].max(0) == pytest.approx(0.0, abs=0.02)
    wrong = SlidingModeObserver(observer.gains, slopes=(100.0, 50.0), model=Model(_two_springs, (10.0, 0.3)))
    assert np.abs(wrong.run(t, x[:, :2], u) - x)[2000:].max() > 0.02


def test_the_implicit_sgn_tracks_without_chatter():
    """In sliding Xhat1 is the measurement and Xhat2 its backward difference: no low-pass, no boundary layer."""
    t, x, u = recording(3000)
    gains = {"m1": (3.0, 3.0), "beta_1": (20.0, 20.0), "beta_2": (0.0, 0.0)}
    xhat = SlidingModeObserver(gains, scheme="implicit").run(t, x[:, :2], u)[2000:]
    y = x[2000:, :2]
    assert np.allclose(xhat[:, :2], y, rtol=0.0, atol=1e-12)
    assert np.allclose(xhat[1:, 2:], np.diff(y, axis=0) / DT, rtol=0.0, atol=1e-9)


def test_equation_26_has_xhat_2_in_the_positions():
    """Without any injection the model of (26) runs on its own, that of (34) stands still."""
    t = DT * np.arange(500)
    y = np.tile([0.0, 0.4], (500, 1))
    gains = {"m1": (1e-12, 1e-12), "beta_1": (0.0, 0.0), "beta_2": (0.0, 0.0)}
    start = (0.1, 0.4, 0.2, 0.0)
    full, printed = (
        SlidingModeObserver(gains, injection=injection, xhat0=start).run(t, y, 0.0 * t) for injection in ("26", "34")
    )
    exact = solve_ivp(lambda s, z: Model.of(CartPendulum()).rate(z, 0.0), (0, t[-1]), start)
    assert np.allclose(full[-1], exact.y[:, -1], atol=1e-3)
    assert np.allclose(printed[-1, :2], start[:2], atol=1e-9)


@inlined
def _growing(h, theta, v, omega):
    return 1.0, 1.0 + abs(omega), 1.0, 1.0


@inlined
def _double(h, theta, v, omega):
    return 2.0, 2.0, 1.0, 1.0


def test_gains_may_depend_on_the_estimate():
    t, x, u = recording(300)
    gains = {"m1": (1.0, 1.0), "beta_1": (5.0, 5.0), "beta_2": (0.0, 0.0)}
    twice = {**gains, "m1": (2.0, 2.0)}
    for scheme in ("rk4", "implicit"):
        one = SlidingModeObserver(gains, scheme=scheme, schedule=_double).run(t, x[:, :2], u)
        assert np.allclose(one, SlidingModeObserver(twice, scheme=scheme).run(t, x[:, :2], u), atol=1e-12)
        other = SlidingModeObserver(gains, scheme=scheme, schedule=_growing).run(t, x[:, :2], u)
        assert not np.allclose(one, other)


def test_slopes_of_each_position():
    t, x, u = recording(100)
    alike, each = (SlidingModeObserver(slopes=s).run(t, x[:, :2], u) for s in ((9.0, 5.0), ((9.0, 9.0), (5.0, 5.0))))
    assert (alike == each).all()
    other = SlidingModeObserver(slopes=((9.0, 3.0), 5.0)).run(t, x[:, :2], u)
    assert (other[-1] != each[-1]).any()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"injection": "27"}, "injection"),
        ({"scheme": "euler"}, "scheme"),
        ({"measurement": "future"}, "measurement"),
        ({"slopes": (1.0, (2.0, -3.0))}, "slopes"),
        ({"xhat0": "y"}, "xhat0"),
        ({"slopes": (math.inf, 12.0)}, "time_constant"),
    ],
)
def test_settings_that_cannot_be(settings, said):
    with pytest.raises(ValueError, match=said):
        SlidingModeObserver(**settings)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, y, u: (t[::-1], y, u), r"t\[1\]=.* must be later than t\[0\]"),
        (lambda t, y, u: (t[:1], y[:1], u[:1]), "two samples or more"),
        (lambda t, y, u: (t, y[:, :1], u), r"y has shape \(50, 1\), it must have shape \(50, 2\)"),
        (lambda t, y, u: (t, y, u[:-1]), "u has shape"),
        (lambda t, y, u: (t, np.where(t[:, None] > 0.02, np.nan, y), u), r"y\[21\]=\[nan, nan\].*leave out"),
    ],
)
def test_recordings_that_cannot_be(change, said):
    t, y, u = DT * np.arange(50), np.zeros((50, 2)), np.zeros(50)
    with pytest.raises(ValueError, match=said):
        SlidingModeObserver().run(*change(t, y, u))


def test_a_right_hand_side_of_another_size():
    with pytest.raises(ValueError, match="must take"):
        Model(_two_springs, (40.0,))


@pytest.mark.parametrize("name", [name for name in OBSERVERS if name not in ("oracle", "mhe")])
def test_every_observer_runs_on_a_recording(name):
    t, x, u = recording(2500)
    xhat = OBSERVERS[name]().run(t, x[:, :2], u)
    assert xhat.shape == (2500, 4)
    assert np.isfinite(xhat).all()
