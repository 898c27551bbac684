"""The article's observer, equations (26)-(35), as blocks for any model."""

from collections.abc import Callable
from typing import Any

from ..typing import Array, State
from . import inlined
from .batch import LANES
from .blocks import XHAT, Y0, Block, U, Y, at, four, offsets, put_four, put_two, two
from .elementary import tanh
from .modelling import Params, Rhs, for_each_model
from .rk4 import rk4, steps_of

Schedule = Callable[[float, float, float, float], State]
"""Factors of (m1_h, m1_theta, m2_h, m2_theta) as a function of xhat."""

PERIOD, STEP, PSI, M1, BETA_1, BETA_2, SLOPES, ALPHA, MODEL = offsets(1, 1, 2, 2, 2, 2, 4, 1)


@inlined
def _unscheduled(h: float, theta: float, v: float, omega: float) -> State:
    return 1.0, 1.0, 1.0, 1.0


@for_each_model
def explicit(rhs: Rhs, params: Params, full: bool, measurement: str, schedule: Schedule | None) -> Block:
    """RK4 steps of (34)-(35), the low-pass of psi2 beside them."""
    line, new_one = measurement == "line", measurement == "new"
    factors, constant = schedule or _unscheduled, schedule is None

    @inlined
    def derivative(xhat: State, s: float, inputs: Any) -> State:
        h, theta, v, omega = xhat
        (h0, theta0, h1, theta1), (m1_h, m1_theta, m2_h, m2_theta), (kp_h, kp_theta, kv_h, kv_theta), low, model = (
            inputs
        )
        held, psi_h, psi_theta = low
        if not constant:
            a, b, c, d = factors(h, theta, v, omega)
            m1_h, m1_theta, m2_h, m2_theta = a * m1_h, b * m1_theta, c * m2_h, d * m2_theta
        h_dot = m1_h * tanh(kp_h * (h0 + s * (h1 - h0) - h))
        theta_dot = m1_theta * tanh(kp_theta * (theta0 + s * (theta1 - theta0) - theta))
        psi_h = psi_h if held > 0.0 else h_dot
        psi_theta = psi_theta if held > 0.0 else theta_dot
        _, _, a_h, a_theta = rhs(xhat, s, model)
        v_dot = m2_h * tanh(kv_h * (psi_h - v)) + a_h
        omega_dot = m2_theta * tanh(kv_theta * (psi_theta - omega)) + a_theta
        if full:
            h_dot, theta_dot = h_dot + v, theta_dot + omega
        return h_dot, theta_dot, v_dot, omega_dot

    def estimate(signals: Array, own: Array, lanes: int) -> None:
        steps, step = steps_of(own[PERIOD * LANES], own[STEP * LANES])
        for j in range(steps):
            a, b = j / steps, (j + 1) / steps
            for i in range(lanes):
                (h0, theta0), (h1, theta1), u = two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
                m1, beta_1, beta_2, k = two(own, M1, i), two(own, BETA_1, i), two(own, BETA_2, i), four(own, SLOPES, i)
                m2 = beta_1[0] + beta_2[0] * abs(u), beta_1[1] + beta_2[1] * abs(u)
                alpha, psi, xhat = at(own, ALPHA, i), two(own, PSI, i), four(signals, XHAT, i)
                if line:
                    dh, dtheta = h1 - h0, theta1 - theta0
                    y = h0 + a * dh, theta0 + a * dtheta, h0 + b * dh, theta0 + b * dtheta
                elif new_one:
                    y = h1, theta1, h1, theta1
                else:
                    y = h0, theta0, h0, theta0
                model = (u,) + params(own, MODEL, i)  # noqa: RUF005  # Numba unpacks no tuple here
                new = rk4(derivative, xhat, (y, (*m1, *m2), k, (alpha, *psi), model), step)
                # the low-pass sees the mean injection over the step
                mean = (new[0] - xhat[0]) / step, (new[1] - xhat[1]) / step
                if full:
                    mean = mean[0] - xhat[2], mean[1] - xhat[3]
                put_two(own, PSI, i, (psi[0] + alpha * (mean[0] - psi[0]), psi[1] + alpha * (mean[1] - psi[1])))
                put_four(signals, XHAT, i, new)

    return estimate


@inlined
def _clipped(x: float) -> float:
    return min(max(x, -1.0), 1.0)


@for_each_model
def implicit(rhs: Rhs, params: Params, full: bool, schedule: Schedule | None) -> Block:
    """Steps that solve for the set-valued sgn at their end."""
    factors = schedule or _unscheduled

    def estimate(signals: Array, own: Array, lanes: int) -> None:
        steps, step = steps_of(own[PERIOD * LANES], own[STEP * LANES])
        for j in range(steps):
            b = (j + 1) / steps
            for i in range(lanes):
                (h0, theta0), (h1, theta1), u = two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
                m1, beta_1, beta_2, xhat = (
                    two(own, M1, i),
                    two(own, BETA_1, i),
                    two(own, BETA_2, i),
                    four(signals, XHAT, i),
                )
                f = factors(*xhat)
                m1 = f[0] * m1[0], f[1] * m1[1]
                m2 = f[2] * (beta_1[0] + beta_2[0] * abs(u)), f[3] * (beta_1[1] + beta_2[1] * abs(u))
                _, _, a_h, a_theta = rhs(xhat, 0.0, (u,) + params(own, MODEL, i))  # noqa: RUF005
                h, theta, v, omega = xhat
                if full:
                    h, theta = h + step * v, theta + step * omega
                psi_h = m1[0] * _clipped((h0 + b * (h1 - h0) - h) / (step * m1[0]))
                psi_theta = m1[1] * _clipped((theta0 + b * (theta1 - theta0) - theta) / (step * m1[1]))
                v, omega = v + step * a_h, omega + step * a_theta
                v += step * m2[0] * _clipped((psi_h - v) / (step * m2[0])) if m2[0] > 0.0 else 0.0
                omega += step * m2[1] * _clipped((psi_theta - omega) / (step * m2[1])) if m2[1] > 0.0 else 0.0
                put_four(signals, XHAT, i, (h + step * psi_h, theta + step * psi_theta, v, omega))

    return estimate
