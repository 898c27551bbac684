"""The equations of motion, the only place where they stand in code."""

from ..typing import State
from . import inlined
from .elementary import sincos

Forces = tuple[float, float, float, float, float, float, float, float]
"""``(F, tau, c, b, M_c, m, l, g)`` of :func:`damped`."""


@inlined
def control_affine(
    sin: float, cos: float, omega: float, M_c: float, m: float, l: float, g: float
) -> tuple[float, float, float, float]:
    """``f2 = (f_h, f_theta)`` of equation (12) and ``g2 = (g_h, g_theta)`` of (18): X2' = f2(x) + g2(x) u.

    The four denominators are one, ``l (M_c + m sin^2 theta)``, up to a factor l. Arithmetic alone: :func:`plain` of
    it takes arrays and symbols too.
    """
    inverse = 1.0 / (l * (M_c + m * sin * sin))
    centrifugal = m * l * omega * omega * sin
    f_h = (centrifugal - m * g * sin * cos) * l * inverse
    f_theta = ((M_c + m) * g * sin - centrifugal * cos) * inverse
    return f_h, f_theta, l * inverse, -cos * inverse


@inlined
def energy(cos: float, v: float, omega: float, M_c: float, m: float, l: float, g: float) -> float:
    """Kinetic and potential energy, the integrand of equation (53)."""
    kinetic = 0.5 * (M_c + m) * v * v + 0.5 * m * l * l * omega * omega + m * l * v * omega * cos
    return kinetic + m * g * l * cos


@inlined
def drift_and_gain(
    theta: float, omega: float, M_c: float, m: float, l: float, g: float
) -> tuple[float, float, float, float]:
    """:func:`control_affine` at an angle."""
    sin, cos = sincos(theta)
    return control_affine(sin, cos, omega, M_c, m, l, g)


@inlined
def plant(x: State, s: float, inputs: tuple[float, float, float, float, float]) -> State:
    """X' = f(x) + g(x) u, equations (3)-(6) and (8), for ``inputs = (u, M_c, m, l, g)``."""
    _, theta, v, omega = x
    u, M_c, m, l, g = inputs
    f_h, f_theta, g_h, g_theta = drift_and_gain(theta, omega, M_c, m, l, g)
    return v, omega, f_h + g_h * u, f_theta + g_theta * u


@inlined
def answer(
    g_h: float, g_theta: float, force: float, torque: float, M_c: float, m: float, l: float
) -> tuple[float, float]:
    """Accelerations that a force on the cart and a torque about the pivot add, with ``(g_h, g_theta)`` of (18).

    The inverse of the mass matrix, which is symmetric: a torque moves the cart by as much as a force turns the rod.
    """
    return g_h * force + g_theta * torque, g_theta * force + (M_c + m) / (m * l * l) * g_h * torque


@inlined
def damped(x: State, s: float, inputs: Forces) -> State:
    """X' for ``inputs = (F, tau, c, b, M_c, m, l, g)``: :func:`plant` with a torque tau and viscous friction.

    ``F - c h'`` acts on the cart and ``tau - b theta'`` about the pivot, each along its coordinate.
    """
    _, theta, v, omega = x
    F, tau, c, b, M_c, m, l, g = inputs
    f_h, f_theta, g_h, g_theta = drift_and_gain(theta, omega, M_c, m, l, g)
    a_h, a_theta = answer(g_h, g_theta, F - c * v, tau - b * omega, M_c, m, l)
    return v, omega, f_h + a_h, f_theta + a_theta


@inlined
def held(x: State, s: float, inputs: Forces) -> State:
    """X' while the cart is held at rest, for inputs as of :func:`damped`."""
    _, theta, _, omega = x
    _, tau, _, b, _, m, l, g = inputs
    sin, _ = sincos(theta)
    return 0.0, omega, 0.0, g * sin / l + (tau - b * omega) / (m * l * l)
