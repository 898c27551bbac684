"""The cart pendulum with friction, in steps that know where the cart comes to rest and where it breaks away."""

from . import inlined
from .cart_pendulum import control_affine
from .elementary import sincos
from .rk4 import State, rk4

Inputs = tuple[float, float, float, float, float, float, float, float, float, float, float]
"""Force, torque, viscous friction of cart and pivot, Coulomb friction, M_c, m, l, g, direction of motion, and whether
the cart is held (1 or 0)."""


@inlined
def _held(theta: float, omega: float, inputs: Inputs) -> tuple[float, float]:
    """Theta'' while the cart is held, and the net force that friction then has to balance."""
    force, torque, _, b, _, _, m, l, g, _, _ = inputs
    sin, cos = sincos(theta)
    alpha = (g * sin + (torque - b * omega) / (m * l)) / l
    return alpha, force - m * l * (cos * alpha - omega * omega * sin)


@inlined
def net_force(x: State, inputs: Inputs) -> float:
    """The force that friction has to balance to hold a cart at rest."""
    return _held(x[1], x[3], inputs)[1]


@inlined
def rubbed(x: State, s: float, inputs: Inputs) -> State:
    """X' with generalised forces: F = force - c h' - F_c sgn h' along the track, tau = torque - b theta' at the pivot.

    The mass matrix is symmetric: what a torque does to the cart is what a force does to the rod.
    """
    _, theta, v, omega = x
    force, torque, c, b, coulomb, M_c, m, l, g, direction, held = inputs
    sin, cos = sincos(theta)
    f_h, f_theta, g_h, g_theta = control_affine(sin, cos, omega, M_c, m, l, g)
    F, tau = force - c * v - coulomb * direction, torque - b * omega
    v_dot = f_h + (g_h * F + g_theta * tau)
    omega_dot = f_theta + (g_theta * F + (M_c + m) / (m * l * l) * g_h * tau)
    alpha, _ = _held(theta, omega, inputs)
    return v, omega, 0.0 if held > 0.0 else v_dot, alpha if held > 0.0 else omega_dot


@inlined
def moved(inputs: Inputs, direction: float, held: float) -> Inputs:
    """The inputs with another motion of the cart."""
    force, torque, c, b, coulomb, M_c, m, l, g, _, _ = inputs
    return force, torque, c, b, coulomb, M_c, m, l, g, direction, held


@inlined
def motion(x: State, inputs: Inputs) -> tuple[float, float]:
    """The direction in which the cart moves or is about to, and whether friction holds it."""
    net, v = net_force(x, inputs), x[2]
    towards = v if v != 0.0 else net
    held = 1.0 if v == 0.0 and abs(net) <= inputs[4] else 0.0
    return 1.0 if towards > 0.0 else (-1.0 if towards < 0.0 else 0.0), held


@inlined
def _crossing(v0: float, v1: float, d0: float, d1: float) -> float:
    """Where in [0, 1] the cubic with these ends and slopes is 0, by Newton's method from its chord."""
    a = v0 / (v0 - v1) if v0 != v1 else 0.0
    c2, c3 = 3.0 * (v1 - v0) - 2.0 * d0 - d1, 2.0 * (v0 - v1) + d0 + d1
    for _ in range(3):
        value, slope = v0 + a * (d0 + a * (c2 + a * c3)), d0 + a * (2.0 * c2 + 3.0 * a * c3)
        next_ = a - value / slope if slope != 0.0 else a
        a = next_ if 0.0 <= next_ <= 1.0 else a
    return a


@inlined
def eventful(x: State, new: State, inputs: Inputs) -> bool:
    """Whether within the step to ``new`` the cart comes to rest, or breaks away."""
    direction, held = inputs[9], inputs[10]
    broken = abs(net_force(new, inputs)) > inputs[4]
    return broken if held > 0.0 else direction * new[2] < 0.0


@inlined
def around(x: State, new: State, inputs: Inputs, dt: float) -> State:
    """The step cut where the cart comes to rest or breaks away."""
    direction, held = inputs[9], inputs[10]
    before, after = abs(net_force(x, inputs)), abs(net_force(new, inputs))
    breaks = (inputs[4] - before) / (after - before) if after > before else 0.0
    stops = _crossing(x[2], new[2], dt * rubbed(x, 0.0, inputs)[2], dt * rubbed(new, 0.0, inputs)[2])
    a = breaks if held > 0.0 else stops
    a = a if 0.0 <= a <= 1.0 else 0.0
    part = rk4(rubbed, x, inputs, a * dt)
    rate = dt * rubbed(part, 0.0, inputs)[2]
    better = a - part[2] / rate if held == 0.0 and rate != 0.0 else a
    a = better if 0.0 <= better <= 1.0 else a
    part = rk4(rubbed, x, inputs, a * dt)
    rest = part[0], part[1], 0.0, part[3]
    net = net_force(rest, inputs)
    onward = 1.0 if net > 0.0 else -1.0
    stuck = 1.0 if held == 0.0 and abs(net) <= inputs[4] else 0.0
    last = rk4(rubbed, rest, moved(inputs, onward, stuck), (1.0 - a) * dt)
    return last[0], last[1], last[2] if stuck > 0.0 or onward * last[2] >= 0.0 else 0.0, last[3]
