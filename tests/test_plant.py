"""The plant against what is independent of it: the Lagrangian, an adaptive solver, energy, finite differences."""

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from smo_gym import CartPendulum
from smo_gym.plant import advance

HANGING, UPRIGHT = CartPendulum(), CartPendulum(gravity=9.8)


def run(plant, x0, u, duration, dt):
    """x(duration) by fixed steps."""
    x = np.array(x0, dtype=float)[:, None]
    advance(x, plant.as_array()[:, None], np.array([u]), dt, np.empty((round(duration / dt), 2, 1)))
    return x[:, 0]


def right_hand_side(plant, u):
    return lambda t, x: plant.drift(x) + plant.gain(x) * u


def test_equations_follow_from_the_lagrangian():
    t, M_c, m, l, g, F = sympy.symbols("t M_c m l g F")
    h, theta = sympy.Function("h")(t), sympy.Function("theta")(t)
    bob = sympy.Matrix([h + l * sympy.sin(theta), l * sympy.cos(theta)])  # theta from the upward vertical
    speed = bob.diff(t)
    lagrangian = M_c * h.diff(t) ** 2 / 2 + m * speed.dot(speed) / 2 - m * g * bob[1]
    equations = [(lagrangian.diff(q.diff(t)).diff(t) - lagrangian.diff(q) - force) for q, force in ((h, F), (theta, 0))]
    accelerations = sympy.solve(equations, [h.diff(t, 2), theta.diff(t, 2)])
    states = sympy.symbols("h theta v omega")
    substitution = [(h.diff(t), states[2]), (theta.diff(t), states[3]), (h, states[0]), (theta, states[1])]
    exact = sympy.lambdify(
        [*states, F, M_c, m, l, g],
        [accelerations[h.diff(t, 2)].subs(substitution), accelerations[theta.diff(t, 2)].subs(substitution)],
    )
    rng = np.random.default_rng(0)
    for _ in range(50):
        plant = CartPendulum(*rng.uniform(0.2, 5.0, 3), rng.uniform(-10, 10))
        x, u = rng.uniform(-4, 4, 4), rng.uniform(-30, 30)
        ours = plant.drift(x) + plant.gain(x) * u
        assert ours[:2].tolist() == x[2:].tolist()
        np.testing.assert_allclose(ours[2:], exact(*x, u, *plant.as_array()), rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("plant", "x0"), [(HANGING, [0, 1.5, 0.3, 2.0]), (UPRIGHT, [0, 0.2, -0.5, 0.1])])
def test_energy_is_conserved_without_force(plant, x0):
    x0 = np.array(x0, dtype=float)
    drift = abs(plant.energy(run(plant, x0, 0.0, 10.0, 0.001)) - plant.energy(x0))
    assert drift < 1e-8 * abs(plant.energy(x0))


def test_power_is_force_times_speed():
    x, u = np.array([0.3, 0.7, -0.4, 1.1]), 12.0
    rate = right_hand_side(HANGING, u)(0.0, x)
    step = 1e-6
    dE_dt = (HANGING.energy(x + step * rate) - HANGING.energy(x - step * rate)) / (2 * step)
    assert dE_dt == pytest.approx(u * x[2], rel=1e-8)


def test_runge_kutta_is_of_fourth_order():
    x0, u = [0.1, 1.0, 0.2, -0.5], 5.0
    exact = solve_ivp(right_hand_side(HANGING, u), (0, 0.96), x0, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    errors = [np.abs(run(HANGING, x0, u, 0.96, dt) - exact).max() for dt in (0.04, 0.02, 0.01)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3.8).all()
    assert (orders < 4.4).all()


@pytest.mark.parametrize("plant", [HANGING, UPRIGHT])
def test_trajectory_agrees_with_an_adaptive_solver(plant):
    x0, u = [0.0, 0.8, 0.5, -1.0], -8.0
    exact = solve_ivp(right_hand_side(plant, u), (0, 3), x0, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(run(plant, x0, u, 3.0, 0.001), exact, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("plant", [HANGING, UPRIGHT])
@pytest.mark.parametrize("theta", [0.0, np.pi])
def test_linearisation_is_the_jacobian(plant, theta):
    A, B = plant.linearise(theta)
    x0 = np.array([0.0, theta, 0.0, 0.0])
    step = 1e-6
    jacobian = np.array([(plant.drift(x0 + step * e) - plant.drift(x0 - step * e)) / (2 * step) for e in np.eye(4)]).T
    np.testing.assert_allclose(A, jacobian, atol=1e-8)
    np.testing.assert_allclose(B[:, 0], plant.gain(x0), atol=1e-15)


def test_theta_zero_is_stable_with_the_printed_gravity_and_unstable_upright():
    def fastest(plant):
        return np.linalg.eigvals(plant.linearise()[0]).real.max()

    assert fastest(HANGING) < 1e-7
    assert fastest(UPRIGHT) > 4.0


def test_linearisation_wants_an_equilibrium():
    with pytest.raises(ValueError, match=r"theta=0\.5 must be a multiple of pi"):
        HANGING.linearise(0.5)


def test_uncertainty_scales_three_parameters_alone_and_uniformly():
    rng = np.random.default_rng(0)
    draws = np.array([HANGING.draw(0.2, rng).as_array() for _ in range(4000)])
    scale = draws / HANGING.as_array()
    assert (scale[:, 3] == 1.0).all()
    assert scale[:, :3].min() == pytest.approx(0.8, abs=1e-3)
    assert scale[:, :3].max() == pytest.approx(1.2, abs=1e-3)
    assert scale[:, :3].std(axis=0) == pytest.approx(0.2 / np.sqrt(3), rel=0.03)
    correlation = np.corrcoef(scale[:, :3].T)
    assert np.abs(correlation[np.triu_indices(3, 1)]).max() < 0.05


def test_states_come_one_or_many():
    x = np.random.default_rng(0).normal(size=(4, 5))
    assert (HANGING.drift(x)[:, 2] == HANGING.drift(x[:, 2])).all()
    assert HANGING.gain(x).shape == (4, 5)


@pytest.mark.parametrize("name", ["cart_mass", "bob_mass", "rod_length"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "heavy"])
def test_masses_and_length_are_positive(name, value):
    with pytest.raises(ValueError, match=f"{name}=.* must be a finite number greater than 0"):
        CartPendulum(**{name: value})


def test_gravity_is_finite():
    with pytest.raises(ValueError, match="gravity=nan must be a finite number"):
        CartPendulum(gravity=np.nan)


def test_a_plant_is_made_of_what_users_have():
    plant = CartPendulum(1.0, 0.2, 0.5, 9.8)
    assert CartPendulum.of(plant) is plant
    assert CartPendulum.of(plant.as_array()) == plant
    assert CartPendulum.of(plant.as_dict()) == plant
    assert CartPendulum.of({"cart_mass": 2.0}, plant) == CartPendulum(2.0, 0.2, 0.5, 9.8)
    assert CartPendulum.of(None) == CartPendulum()
    with pytest.raises(ValueError, match=r"unknown plant parameter 'bob_mas': did you mean 'bob_mass'\?"):
        CartPendulum.of({"bob_mas": 1.0})
    with pytest.raises(ValueError, match=r"params has shape \(3,\), it must have shape \(4,\)"):
        CartPendulum.of([1.0, 2.0, 3.0])
