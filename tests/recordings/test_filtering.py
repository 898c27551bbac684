"""The extended Kalman filter and its smoother, on a linear model beside filterpy's."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from smo_gym.kernels import inlined
from smo_gym.models import Model
from smo_gym.recordings import CART_POLE, Recording, filtering, smoothing

PERIOD = 0.02


@inlined
def sprung(x, s, inputs):
    u, stiffness = inputs
    return x[2], x[3], u - x[2], -stiffness * x[1] + 0.5 * u


def rig_and_run(u):
    """A linear rig, and a run of it with a gap and a fault."""
    rig = replace(CART_POLE, model=Model(sprung, (9.0,)), noise=(1e-3, 2e-3), acceleration=(0.3, 0.2))
    t = PERIOD * np.delete(np.arange(300), 50)
    noise = np.random.default_rng(1).normal(size=(299, 2)) * rig.noise
    fault = np.zeros(299, dtype=bool)
    fault[[120, 121]] = True
    y = np.column_stack([0.1 * np.sin(2.0 * t), 0.2 * np.cos(3.0 * t)]) + noise
    return rig, Recording("linear", t, y, u * np.sin(3.0 * t), fault)


def step(h):
    """Runge-Kutta is the exponential to the fourth order, twice over half of h; so is what u does meanwhile."""
    A = np.zeros((5, 5))
    A[[0, 1], [2, 3]] = 1.0
    A[2, 2], A[2, 4], A[3, 1], A[3, 4] = -1.0, 1.0, -9.0, 0.5
    B = 0.5 * h * A
    half = np.eye(5) + B @ (np.eye(5) + B @ (np.eye(5) + B @ (np.eye(5) + B / 4.0) / 3.0) / 2.0)
    whole = half @ half
    push = np.array([[0.09, 0.045], [0.045, 0.0225 + 0.04]])
    return whole[:4, :4], whole[:4, 4], np.kron([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]], push)


def beside(rig, recording):
    """filterpy's filter along a recording: a position that is not seen is one of huge noise."""
    t, y, huge = recording.t, recording.y, 1e3
    other = KalmanFilter(4, 2)
    other.H[:, :2] = np.eye(2)
    other.x = np.r_[y[0], (y[2] - y[0]) / (t[2] - t[0])]
    other.P = np.diag(np.square([*rig.noise, *filtering.START]))
    states, covariances, steps, loss = [other.x], [other.P], [step(PERIOD)], 0.0
    for k in range(1, len(t)):
        F, G, Q = step(t[k] - t[k - 1])
        other.predict(recording.u[k - 1], F=F, B=G, Q=Q)
        other.R = np.diag([rig.noise[0] ** 2, huge if recording.fault[k] else rig.noise[1] ** 2])
        other.update(y[k])
        if k >= filtering.SETTLED:
            loss -= other.log_likelihood + np.log(2.0 * np.pi) + 0.5 * np.log(huge) * recording.fault[k]
        states, covariances, steps = [*states, other.x], [*covariances, other.P], [*steps, (F, G, Q)]
    return other, np.array(states), np.array(covariances), steps, loss


def test_the_filter_is_filterpys_where_the_model_is_linear():
    rig, recording = rig_and_run(1.0)
    _, states, covariances, _, loss = beside(rig, recording)
    along = filtering.filtered(rig, recording)
    np.testing.assert_allclose(along.x, states, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(along.P, covariances, rtol=1e-6, atol=1e-12)
    assert along.innovations == 2 * (299 - 6) - 2
    assert along.loss == pytest.approx(loss, abs=1e-4)


def test_the_smoother_is_filterpys_which_knows_no_input():
    rig, recording = rig_and_run(0.0)
    other, states, covariances, steps, _ = beside(rig, recording)
    smooth, P, _, _ = other.rts_smoother(states, covariances, [F for F, _, _ in steps], [Q for _, _, Q in steps])
    x, sd, _ = smoothing.smoothed(rig, recording)
    np.testing.assert_allclose(x, smooth, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(sd, np.sqrt(np.diagonal(P, axis1=1, axis2=2)), rtol=1e-6)
