"""The minimum-energy reference and the environment that follows it."""

from dataclasses import asdict, replace

import gymnasium
import numpy as np
import pytest

from smo_gym import LQR, CartPendulum, ObserverWrapper, Reference
from smo_gym.reference import ReferenceNotFound, minimum_energy, shipped

START = (1.0, 1.0, 0.1, 0.01)


@pytest.fixture(scope="module")
def solved():
    pytest.importorskip("casadi")
    return minimum_energy(START, horizon=4.0, force_limit=26.0, elements=80)


def test_its_own_force_brings_the_plant_to_the_end(solved):
    x_d = solved.trajectory(0.001)
    assert x_d.shape == (4, 4001)
    assert x_d[:, 0].tolist() == list(START)
    assert np.abs(x_d[:, -1]).max() < 1e-6
    assert np.abs(solved.u).max() <= 26.0 + 1e-6


def test_its_cost_is_the_integral_of_the_energy(solved):
    energy = CartPendulum().energy(solved.trajectory(0.001))
    assert np.trapezoid(energy, dx=0.001) == pytest.approx(solved.cost, abs=2e-4)


def test_a_finer_mesh_changes_the_cost_by_less_than_a_thousandth(solved):
    finer = minimum_energy(START, horizon=4.0, force_limit=26.0, elements=80, refine=2)
    assert abs(finer.cost / solved.cost - 1) < 1e-6
    freer = minimum_energy(START, horizon=4.0, force_limit=26.0, elements=160)
    assert abs(freer.cost / solved.cost - 1) < 1e-3
    assert freer.cost <= solved.cost + 1e-9  # it has every force of the coarser one


def test_long_elements_are_as_exact_as_short_ones():
    pytest.importorskip("casadi")
    coarse = minimum_energy(START, horizon=8.0, force_limit=26.0, elements=16)
    assert np.abs(coarse.trajectory(0.001)[:, -1]).max() < 1e-6


def test_any_other_force_that_ends_there_costs_more(solved):
    energy = CartPendulum().energy(solved.trajectory(0.001)).mean()
    for bound in (10.0, 6.0):
        limited = minimum_energy(START, horizon=4.0, force_limit=bound, elements=80)
        assert np.abs(limited.u).max() <= bound + 1e-6
        assert CartPendulum().energy(limited.trajectory(0.001)).mean() > energy


def test_what_cannot_be_reached_is_said_with_the_reason():
    pytest.importorskip("casadi")
    with pytest.raises(
        ReferenceNotFound, match=r"no minimum-energy trajectory .* in 0\.3 s with \|F\| <= 26 N: IPOPT says"
    ):
        minimum_energy(START, horizon=0.3, elements=20)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"x0": [1, 2]}, r"x0 has shape \(2,\)"),
        ({"x0": START, "horizon": -1.0}, "horizon=-1.0 must be a finite number greater than 0"),
        ({"x0": START, "force_limit": np.inf}, "force_limit=inf must be a finite number greater than 0"),
        ({"x0": START, "elements": 0}, "elements=0 must be a positive integer"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        minimum_energy(**arguments)


def test_the_shipped_reference_needs_no_solver_and_ends_at_rest():
    reference = shipped()
    x_d = reference.trajectory(0.001)
    assert np.abs(x_d[:, -1] - reference.xT).max() < 1e-6
    assert Reference.from_json(reference.to_json()) == reference


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"horizn": 1.0}, r"unknown field of a reference 'horizn': did you mean 'horizon'\?"),
        ({"x0": [1.0]}, r"reference x0 has shape \(1,\)"),
        ({"horizon": 0.0}, "reference horizon=0.0"),
        ({"u": []}, r"reference u has shape \(0,\)"),
        ({"u": 3.0}, r"reference u has shape \(\)"),
        ({"params": [-1.0, 0.3, 0.4, 9.8]}, "cart_mass=-1.0 must be"),
    ],
)
def test_bad_references_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        Reference.of({**asdict(shipped()), **change})


def test_the_observation_tells_the_reference_now_and_ahead():
    env = gymnasium.make("SMOPendulumTracking-v0", preview=3)
    x_d = env.unwrapped.task.reference.trajectory(0.001)[:, ::20].T
    observation, info = env.reset(seed=0)
    assert observation.shape == (2 + 4 * 4,)
    assert (info["state"] == x_d[0]).all()
    for k in range(1, 30):
        assert (observation[2:].reshape(4, 4) == x_d[k - 1 : k + 3]).all()
        observation, *_, info = env.step(np.ones(1))
        assert (info["desired"][-1] == x_d[k, :2]).all()


def test_after_the_reference_there_is_rest():
    env = gymnasium.make("SMOPendulumTracking-v0", horizon=11.0)
    observation, _ = env.reset(seed=0)
    truncated = False
    steps = 0
    while not truncated:
        observation, _, _, truncated, _ = env.step(np.zeros(1))
        steps += 1
    assert steps == 550
    assert (observation[2:] == 0.0).all()


def test_a_held_slot_is_told_the_same_reference(make_vec):
    env = make_vec(2, "SMOPendulumTracking-v0", autoreset_mode="Disabled", track_limit=1.5)
    env.reset(seed=0, options={"state": np.array([[1.49, 0, 5, 0], [1, 1, 0.1, 0.01]])})
    observation, _, terminated, *_ = env.step(np.zeros((2, 1)))
    assert terminated.tolist() == [True, False]
    later = [env.step(np.zeros((2, 1))) for _ in range(3)][-1]
    assert (later[0][0] == observation[0]).all()
    assert (later[0][1] != observation[1]).any()
    assert (later[4]["desired"][0, -1] == observation[0, 2:4]).all()


def test_a_reference_belongs_to_its_plant_and_ends_at_rest():
    with pytest.raises(ValueError, match="reference was computed for the plant"):
        gymnasium.make("SMOPendulumTracking-v0", params={"gravity": 9.8})
    moving = replace(shipped(), xT=(0.0, 0.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="must be an equilibrium"):
        gymnasium.make("SMOPendulumTracking-v0", reference=moving)


def test_the_reward_weighs_the_error():
    env = gymnasium.make("SMOPendulumTracking-v0", reward={"q": (1, 1, 1, 1), "r": 0.0})
    env.reset(seed=0)
    observation, reward, *_, info = env.step(np.zeros(1))
    assert reward == pytest.approx(-0.02 * np.sum((info["state"] - observation[2:6]) ** 2), rel=1e-12)


def test_feedforward_on_the_nominal_plant_follows_exactly():
    env = gymnasium.make("SMOPendulumTracking-v0", uncertainty=0.0, control_period=0.01, force_limit=None)
    reference = env.unwrapped.task.reference
    observation, _ = env.reset(seed=0)
    for u in np.repeat(reference.u, round(reference.horizon / len(reference.u) / 0.01)):
        observation, *_ = env.step(np.array([u]))
        assert np.abs(observation[:2] - observation[2:4]).max() < 1e-9


def test_lqr_follows_better_than_it_would_by_resting():
    env = ObserverWrapper(gymnasium.make("SMOPendulumTracking-v0", uncertainty=0.0), "oracle")
    agent = LQR([7.2, -4.0, 11.0, -1.0])

    def error(follow):
        observation, _ = env.reset(seed=0)
        squares, truncated = [], False
        while not truncated:
            action = agent.predict(observation)[0] if follow else np.zeros(1)
            observation, _, _, truncated, info = env.step(action)
            squares.append((info["samples"] - info["desired"]) ** 2)
        return np.mean(squares)

    assert error(follow=True) < 0.5 * error(follow=False)


def test_another_reference_sets_start_and_horizon():
    other = Reference((0.5, 0.0, 0.0, 0.0), (0, 0, 0, 0), 2.0, 1.0, 0.0, (0.0,) * 20, (3.5, 0.32, 0.44, -9.8))
    for given in (other, asdict(other)):
        env = gymnasium.make("SMOPendulumTracking-v0", reference=given)
        assert env.unwrapped.task.horizon == 2.0
        _, info = env.reset(seed=0)
        assert info["state"].tolist() == [0.5, 0.0, 0.0, 0.0]
        assert env.unwrapped.task.reference == other
