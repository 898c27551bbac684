"""Friction against what is independent of it: adaptive solvers with events, work along the path, symmetry."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from smo_gym import CartPendulum
from smo_gym.friction import Friction, rubbing
from smo_gym.kernels.blocks import FAILED, FORCE, PUSH
from smo_gym.loop import Loop
from smo_gym.plant import moving

HANGING, UPRIGHT = [3.5, 0.32, 0.44, -9.8], [3.5, 0.32, 0.44, 9.8]
START = [0.1, 0.8, 0.5, -1.0]


def run(x0, dt, steps, friction=(0.0, 0.0, 0.0), params=HANGING, back_emf=0.0, force=0.0, push=0.0, torque=0.0):
    """States (4, n) and mean forces (n,) after each step, for forces that are numbers or functions of time."""
    x0 = np.array(x0, dtype=float).reshape(4, -1)
    n = x0.shape[1]
    params, friction = (
        np.broadcast_to(np.reshape(each, (len(each), -1)), (len(each), n)) for each in (params, friction)
    )
    loop = Loop(n, 1, {"plant": rubbing(params, dt, friction, back_emf)})
    loop.start(slice(None), x0)
    states, forces = [x0], []
    for k in range(steps):
        now = [each((k + 0.5) * dt) if callable(each) else each for each in (force, push, torque)]
        loop.rows[FORCE], loop.rows[PUSH], loop.rows[PUSH + 1] = now
        loop.run()
        states.append(loop.x.copy())
        forces.append(loop.rows[FORCE].copy())
    return np.array(states), np.array(forces)


def accelerations(x, force, torque, params):
    """h'' and theta'' from the two balances, solved as a linear system."""
    M_c, m, l, g = params
    _, theta, _, omega = x
    mass = [[M_c + m, m * l * np.cos(theta)], [m * l * np.cos(theta), m * l**2]]
    return np.linalg.solve(mass, [force + m * l * omega**2 * np.sin(theta), torque + m * g * l * np.sin(theta)])


def solved(x0, end, friction, params=HANGING, back_emf=0.0, force=0.0, torque=0.0):
    """x(end), with Coulomb friction as a machine of three states (slides either way, sticks) cut at its events."""
    c, coulomb, b = friction
    _, m, l, g = params

    def sliding(way):
        return lambda t, x: [
            *x[2:],
            *accelerations(x, force - (c + back_emf) * x[2] - way * coulomb, torque - b * x[3], params),
        ]

    def sticking(t, x):
        return [0.0, x[3], 0.0, g / l * np.sin(x[1]) + (torque - b * x[3]) / (m * l**2)]

    def needed(t, x):
        """What holds the cart, in N, from the cart's balance alone."""
        return m * l * (np.cos(x[1]) * sticking(t, x)[3] - np.sin(x[1]) * x[3] ** 2) - force

    def speed(t, x):
        return x[2]

    def loose(t, x):
        return abs(needed(t, x)) - coulomb

    speed.terminal = loose.terminal = True
    loose.direction = 1.0
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12, "max_step": 0.02}  # no two events in one
    t, x = 0.0, np.array(x0, dtype=float)
    if coulomb == 0.0:
        return solve_ivp(sliding(0.0), (0.0, end), x, **tight).y[:, -1], 0
    way, events = np.sign(x[2]), 0
    while t < end:
        speed.direction = -way
        found = solve_ivp(sliding(way) if way else sticking, (t, end), x, events=speed if way else loose, **tight)
        t, x = found.t[-1], found.y[:, -1]
        events += t < end
        way = 0.0 if way and loose(t, x) <= 0.0 else -np.sign(needed(t, x))
        x[2] = 1e-12 * way if t < end else x[2]  # off the event, where it would be found again
    return x, events


@pytest.mark.parametrize("params", [HANGING, UPRIGHT])
def test_viscous_friction_and_pushes_agree_with_an_adaptive_solver(params):
    friction = (2.0, 0.0, 0.01)
    exact, _ = solved(START, 2.0, friction, params, 1.5, -8.0 + 3.0, 0.2)
    states, _ = run(START, 0.001, 2000, friction, params, 1.5, -8.0, 3.0, 0.2)
    np.testing.assert_allclose(states[-1, :, 0], exact, rtol=1e-9, atol=1e-9)


# friction, x0, end, events: both; one that comes loose at once; one that never sticks
CASES = [
    ((0.5, 2.5, 0.002), [0.0, 2.0, 0.4, 0.0], 2.0, 6),
    ((0.5, 1.5, 0.002), [0.0, 1.2, 0.3, 0.0], 2.0, 4),
    ((0.5, 0.6, 0.002), [0.0, 2.5, 0.2, 0.0], 2.0, 2),
]


@pytest.mark.parametrize(("friction", "x0", "end", "events"), CASES)
def test_coulomb_friction_keeps_the_order_through_stops_and_starts(friction, x0, end, events):
    exact, seen = solved(x0, end, friction, force=0.2)
    steps = [100, 200, 400, 800, 1600]
    errors = [np.abs(run(x0, end / n, n, friction, force=0.2)[0][-1, :, 0] - exact).max() for n in steps]
    assert seen == events
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] < -3.4
    assert errors[-1] < 1e-9


def test_without_coulomb_friction_a_step_is_of_fourth_order():
    exact, _ = solved(START, 0.96, (1.0, 0.0, 0.01), torque=0.1)
    errors = [
        np.abs(run(START, 0.96 / n, n, (1.0, 0.0, 0.01), torque=0.1)[0][-1, :, 0] - exact).max() for n in (24, 96)
    ]
    assert 3.8 < np.log2(errors[0] / errors[1]) / 2 < 4.4


def test_what_does_not_rub_moves_as_the_plant_without_friction():
    x0 = np.random.default_rng(0).normal(size=(4, 9))
    states, _ = run(x0, 0.001, 300, force=-8.0)
    params = np.repeat(np.array(HANGING)[:, None], 9, axis=1)
    loop = Loop(9, 300, {"plant": moving(params, 0.001)})
    loop.start(slice(None), x0)
    loop.u[:] = -8.0
    loop.run()
    np.testing.assert_allclose(states[-1], loop.x, rtol=0, atol=1e-13)


def test_a_pushed_cart_stops_and_stays_to_the_bit():
    states, _ = run([0.0, 0.3, 0.5, 0.0], 0.002, 20_000, (1.0, 2.0, 0.12), force=lambda t: 0.5 * (t > 10.0))
    h, theta, v, omega = states[:, :, 0].T
    stopped = int(np.argmax(v == 0.0))
    assert 50 < stopped < 1000
    assert (v[stopped:] == 0.0).all()
    assert (h[stopped:] == h[stopped]).all()
    assert abs(theta[-1]) + abs(omega[-1]) < 1e-12  # the rod swings out on a cart that stands


@pytest.mark.parametrize("x0", [[0.2, 0.0, 0.0, 0.0], [0.2, 0.0, -0.0, 0.0]])
def test_a_cart_sticks_up_to_coulombs_force_and_slides_above(x0):
    friction = 0.0, 2.0, 0.0
    assert (run(x0, 0.001, 500, friction, force=2.0)[0][:, :, 0] == x0).all()
    assert (run(x0, 0.001, 500, friction, force=-5.0, push=3.0)[0][:, :, 0] == x0).all()
    for force in (2.001, -2.001):
        v = run(x0, 0.001, 500, friction, force=force)[0][1:, 2, 0]
        assert (v * force > 0.0).all()


def test_one_step_is_cut_where_the_cart_stops():
    decelerated = run([0.0, 0.0, 0.001, 0.0], 0.1, 1, (0.0, 2.0, 0.0), [3.5, 1e-9, 0.44, -9.8])[0][-1, :, 0]
    assert decelerated[2] == 0.0
    assert decelerated[0] == pytest.approx(0.001**2 / (2.0 * 2.0 / 3.5), rel=1e-6)  # v^2 / 2a


@pytest.mark.parametrize("params", [HANGING, UPRIGHT])
def test_energy_falls_by_the_work_of_friction(params):
    friction, back_emf, push, torque, dt = (0.8, 2.5, 0.01), 1.2, 0.4, 0.05, 1e-4
    states, forces = run([0.0, 2.0, 0.4, 0.0], dt, 20_000, friction, params, back_emf, 3.0, push, torque)
    h, theta, v, omega = states[:, :, 0].T

    def integral(power):
        return dt * ((power[1:-1]).sum() + 0.5 * (power[0] + power[-1]))

    braked = (friction[0] + back_emf) * integral(v**2) + friction[1] * np.abs(np.diff(h)).sum()
    given = (3.0 + push) * (h[-1] - h[0]) + torque * (theta[-1] - theta[0])
    work = given - braked - friction[2] * integral(omega**2)
    change = np.diff(CartPendulum(*params).energy(states[[0, -1], :, 0].T))[0]
    assert change == pytest.approx(work, rel=0, abs=1e-6 * braked)
    delivered = 3.0 * (h[-1] - h[0]) - back_emf * integral(v**2)
    assert (forces[:, 0] * np.diff(h)).sum() == pytest.approx(delivered, rel=0, abs=1e-6 * braked)


def test_back_emf_is_taken_from_the_force_that_reaches_the_cart():
    states, forces = run(START, 0.001, 50, back_emf=4.0, force=3.0)
    np.testing.assert_allclose(forces[:, 0], 3.0 - 4.0 * np.diff(states[:, 0, 0]) / 0.001, atol=1e-9)
    v = states[:, 2, 0]
    np.testing.assert_allclose(forces[:, 0], 3.0 - 2.0 * (v[1:] + v[:-1]), atol=1e-4)


def test_a_mirrored_plant_moves_mirrored_to_the_bit():
    x0 = np.random.default_rng(1).normal(size=(4, 64))
    here, mean = run(x0, 0.002, 1000, (0.5, 1.5, 0.002), back_emf=0.3, force=0.7, push=0.1, torque=0.02)
    there, opposite = run(-x0, 0.002, 1000, (0.5, 1.5, 0.002), back_emf=0.3, force=-0.7, push=-0.1, torque=-0.02)
    assert (here[:, 2] == 0.0).any()
    assert (here == -there).all()
    assert (mean == -opposite).all()


@pytest.mark.parametrize("n", [1, 5, 64])
def test_a_slot_has_the_same_bits_in_every_batch(n):
    rng = np.random.default_rng(2)
    x0, coulomb = rng.normal(size=(4, 130)), rng.uniform(0.0, 2.0, 130)
    coulomb[::3] = 0.0  # slots that only rub where others stick
    friction = np.array([np.full(130, 0.5), coulomb, np.full(130, 0.002)])
    whole, force = run(x0, 0.001, 1500, friction, back_emf=0.3)
    for first in (0, 3, 130 - n):
        mine = slice(first, first + n)
        states, forces = run(x0[:, mine], 0.001, 1500, friction[:, mine], back_emf=0.3)
        assert (states == whole[..., mine]).all()
        assert (forces == force[:, mine]).all()


@pytest.mark.parametrize("coulomb", [0.0, 1.0])
def test_a_state_that_would_not_be_finite_fails_and_stays(coulomb):
    x0 = np.array([[0.0, 0.0], [0.1, 0.1], [0.0, 0.0], [0.0, 1e200]])
    friction = np.repeat([[0.5], [coulomb], [0.0]], 2, axis=1)
    loop = Loop(2, 1, {"plant": rubbing(np.repeat(np.array(HANGING)[:, None], 2, axis=1), 0.001, friction)})
    loop.start(slice(None), x0)
    loop.rows[FORCE] = 5.0
    for _ in range(3):
        loop.run()
    assert loop.rows[FAILED].tolist() == [0.0, 1.0]
    assert loop.x[:, 1].tolist() == x0[:, 1].tolist()
    assert loop.x[0, 0] > 0.0


@pytest.mark.parametrize("params", [HANGING, UPRIGHT])
@pytest.mark.parametrize("theta", [0.0, np.pi])
def test_linearisation_has_viscous_friction(params, theta):
    plant = CartPendulum(*params, friction=Friction(2.0, 0.7, 0.03))
    A, _ = plant.linearise(theta)
    x0, step = np.array([0.0, theta, 0.0, 0.0]), 1e-6

    def rate(x):
        return [*x[2:], *accelerations(x, -2.0 * x[2], -0.03 * x[3], params)]

    jacobian = [np.subtract(rate(x0 + step * e), rate(x0 - step * e)) / (2 * step) for e in np.eye(4)]
    np.testing.assert_allclose(A, np.transpose(jacobian), atol=1e-7)
    x = np.random.default_rng(3).normal(size=(4, 6))
    np.testing.assert_allclose(plant.drift(x), np.transpose([rate(each) for each in x.T]), rtol=1e-10)


def test_a_hanging_rod_is_damped_by_friction():
    def swinging(friction):
        poles = control.ss(*CartPendulum(friction=friction).linearise(), np.eye(4), 0).poles()
        return poles[np.abs(poles.imag) > 1.0]

    assert swinging(None).real == pytest.approx([0.0, 0.0], abs=1e-9)
    cart, pivot = swinging(Friction(2.0, 0.5, 0.0)).real, swinging(Friction(0.0, 0.5, 0.01)).real
    assert (cart < -0.01).all()
    assert pivot == pytest.approx([-0.5 * 0.01 / (0.32 * 0.44**2) * (3.5 + 0.32) / 3.5] * 2)


def test_a_plant_with_friction_is_made_of_what_users_have():
    plant = CartPendulum(friction={"cart_viscous": 1.0, "pivot_viscous": 0.1})
    assert plant.friction == Friction(1.0, 0.0, 0.1)
    assert CartPendulum.of(plant.as_dict()) == plant
    assert eval(repr(plant)) == plant
    assert CartPendulum.of({"cart_mass": 2.0}, plant).friction == plant.friction
    assert CartPendulum.of([1.0, 0.2, 0.5, 9.8], plant).friction == plant.friction
    assert plant.perturbed([0.1, 0.0, 0.0]).friction == plant.friction
    assert "friction" not in CartPendulum().as_dict()
    assert "friction" not in repr(CartPendulum())
    assert Friction.of(None) == Friction.of({}) == Friction()
    assert not Friction()
    assert Friction(0.0, 0.0, 1e-9)


@pytest.mark.parametrize("name", ["cart_viscous", "cart_coulomb", "pivot_viscous"])
@pytest.mark.parametrize("value", [-1.0, np.nan, "much"])
def test_bad_friction_is_named(name, value):
    with pytest.raises(ValueError, match=f"{name}=.* must be"):
        CartPendulum(friction={name: value})


def test_unknown_friction_is_named():
    with pytest.raises(ValueError, match=r"unknown friction 'cart_coulom': did you mean 'cart_coulomb'\?"):
        Friction.of({"cart_coulom": 1.0})
    with pytest.raises(ValueError, match="friction: 0.5 must be a mapping"):
        CartPendulum(friction=0.5)
