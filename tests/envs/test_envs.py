"""The scalar environments: the checks of Gymnasium and Stable-Baselines3, the end of an episode, refusals."""

import json
import warnings

import gymnasium
import numpy as np
import pytest
from conftest import IDS, assert_same
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import smo_gym
from smo_gym import CartPendulum, ObserverWrapper, Oracle, SlidingModeObserver

# Warnings of the checkers that state a design decision, not a defect.
EXPLAINED = (
    "-infinity",  # encoders count without end: the angle is not wrapped
    "is infinity",
    "symmetric and normalized space",  # actions are newtons; RescaleAction stands outside the observer
    "different from the unwrapped version",  # the checker is meant to look at the wrapped environment too
)


@pytest.mark.parametrize("wrapped", [False, True])
def test_gymnasium_finds_nothing_unexplained(env_id, wrapped, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # it opens a window
    env = gymnasium.make(env_id, disable_env_checker=True)
    env = ObserverWrapper(env) if wrapped else env.unwrapped
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env)
    unexplained = [str(w.message) for w in caught if not any(text in str(w.message) for text in EXPLAINED)]
    assert unexplained == []


@pytest.mark.parametrize("wrapped", [False, True])
def test_stable_baselines3_finds_nothing_unexplained(env_id, wrapped):
    sb3_check = pytest.importorskip("stable_baselines3.common.env_checker").check_env
    env = gymnasium.make(env_id)
    env = gymnasium.wrappers.RescaleAction(ObserverWrapper(env) if wrapped else env, -1.0, 1.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sb3_check(env, warn=True)
    explained = (*EXPLAINED, "np.float32")  # control loops run in float64; SB3 casts
    assert [str(w.message) for w in caught if not any(text in str(w.message) for text in explained)] == []


def test_ids_are_registered_once_and_also_by_module_prefix():
    import importlib

    importlib.reload(smo_gym)
    for id in IDS:
        assert gymnasium.make(f"smo_gym:{id}").unwrapped.spec.id == id


def test_theta_zero_hangs_or_stands(env_id):
    env = gymnasium.make(env_id, track_limit=None, uncertainty=0.0).unwrapped
    env.reset(options={"state": [0, 0.01, 0, 0]})
    angles = [env.step(np.zeros(1))[0][1] for _ in range(60)]
    if env_id != "SMOPendulumUpright-v0":
        assert np.abs(angles).max() < 0.0101
    else:
        assert np.abs(angles).max() > 0.1


def test_defaults_are_the_documented_ones():
    task = gymnasium.make("SMOPendulum-v0").unwrapped.task
    assert (task.control_period, task.dt, task.horizon, task.uncertainty) == (0.02, 0.001, 35.0, 0.1)
    assert (task.force_limit, task.track_limit, task.angle_limit) == (30.0, 5.0, np.inf)
    assert task.params == CartPendulum(3.5, 0.32, 0.44, -9.8)
    assert task.initial_state == ((-1, -1, 0.1, 0.01), (1, 1, 0.1, 0.01))
    upright = gymnasium.make("SMOPendulumUpright-v0").unwrapped.task
    assert upright.params == CartPendulum(3.5, 0.32, 0.44, 9.8)
    assert upright.angle_limit == np.pi / 2
    assert [s[1] for s in upright.initial_state] == [-0.2, 0.2]


def test_part_of_params_keeps_the_rest_of_the_environments_own():
    env = gymnasium.make("SMOPendulumUpright-v0", params={"bob_mass": 0.5}).unwrapped
    assert env.task.params == CartPendulum(bob_mass=0.5, gravity=9.8)
    _, info = env.reset(options={"params": {"rod_length": 0.3}})
    assert info["params"].tolist() == [3.5, 0.5, 0.3, 9.8]


def test_every_episode_draws_its_own_plant_and_start():
    env = gymnasium.make("SMOPendulum-v0", uncertainty=0.2)
    _, first = env.reset(seed=3)
    _, second = env.reset()
    _, again = env.reset(seed=3)
    assert (first["params"] != second["params"])[:3].all()
    assert first["params"][3] == second["params"][3] == -9.8
    assert (first["state"][:2] != second["state"][:2]).all()
    assert_same(first, again)


def test_reset_replays_one_exact_case():
    env = gymnasium.make("SMOPendulum-v0")
    _, drawn = env.reset(seed=1)
    case = {"state": drawn["state"], "params": drawn["params"]}
    steps = [env.step(np.array([2.0]))[4] for _ in range(5)]
    _, info = env.reset(seed=99, options=case)
    assert_same(info, drawn)
    for step in steps:
        assert_same(env.step(np.array([2.0]))[4], step)


def test_options_do_not_shift_the_random_stream():
    env = gymnasium.make("SMOPendulum-v0")
    env.reset(seed=5)
    _, plain = env.reset()
    env.reset(seed=5, options={"state": [0, 0, 0, 0], "params": CartPendulum()})
    _, after_options = env.reset()
    assert_same(plain, after_options)


def test_information_has_the_same_keys_at_every_step(env_id, make_vec):
    env = gymnasium.make(env_id)
    _, info = env.reset(seed=0)
    keys = {"state", "params", "asked", "force", "samples", "positions"} | (
        {"desired"} if "Tracking" in env_id else set()
    )
    assert info.keys() == keys
    for _ in range(5):
        info = env.step(env.action_space.sample())[4]
        assert info.keys() == keys
        assert info["samples"].shape == (20, 2)
        assert (info["samples"][-1] == info["state"][:2]).all()


def test_force_is_held_and_clipped():
    env = gymnasium.make("SMOPendulum-v0", force_limit=10.0, uncertainty=0.0)
    env.reset(options={"state": [0, 0, 0, 0]})
    *_, info = env.step(np.array([25.0]))
    assert info["force"] == 10.0
    assert info["state"][2] == pytest.approx(10.0 / 3.5 * 0.02, rel=2e-3)


def test_reward_is_the_documented_quadratic():
    weights = {"q": (1.0, 2.0, 3.0, 4.0), "r": 0.5, "failure": 7.0}
    env = gymnasium.make("SMOPendulum-v0", reward=weights, track_limit=0.5)
    env.reset(options={"state": [0.1, 0.2, 0.3, 0.4]})
    _, reward, _, _, info = env.step(np.array([3.0]))
    cost = 0.02 * (np.dot(weights["q"], info["state"] ** 2) + 0.5 * 9.0)
    assert reward == pytest.approx(-cost, rel=1e-12)
    env.reset(options={"state": [0.49, 0.0, 5.0, 0.0]})
    _, reward, terminated, _, info = env.step(np.array([3.0]))
    assert terminated
    assert reward == pytest.approx(-0.02 * (np.dot(weights["q"], info["state"] ** 2) + 0.5 * 9.0) - 7.0, rel=1e-12)


@pytest.mark.parametrize(
    ("id", "state"), [("SMOPendulum-v0", [4.99, 0, 3, 0]), ("SMOPendulumUpright-v0", [0, -1.55, 0, -3])]
)
def test_leaving_the_track_or_falling_terminates(id, state):
    env = gymnasium.make(id)
    env.reset(options={"state": state})
    _, _, terminated, truncated, _ = env.step(np.zeros(1))
    assert (terminated, truncated) == (True, False)
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(np.zeros(1))


def test_a_state_that_is_not_finite_terminates_with_the_penalty_alone():
    env = gymnasium.make("SMOPendulum-v0", force_limit=None, track_limit=None).unwrapped
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, reward, terminated, truncated, info = env.step(np.array([1e308]))
        assert not truncated
    assert np.isfinite(info["state"]).all()  # the last one that was
    assert np.isfinite(info["samples"]).all()
    assert reward == -100.0


def test_the_horizon_truncates():
    env = gymnasium.make("SMOPendulum-v0", horizon=0.1)
    env.reset(seed=0)
    flags = [env.step(np.zeros(1))[2:4] for _ in range(5)]
    assert flags == [(False, False)] * 4 + [(False, True)]


def test_a_user_cannot_reach_the_environment_through_what_it_returned(make_vec):
    env = make_vec(2)
    _, info = env.reset(seed=0)
    for key in ("params", "_params", "_state"):
        with pytest.raises(ValueError, match="read-only"):
            info[key][:] = 0
    info["state"][:] = 0.0
    info["samples"][:] = 0.0
    twin = make_vec(2)
    twin.reset(seed=0)
    assert (env.step(np.zeros((2, 1)))[0] == twin.step(np.zeros((2, 1)))[0]).all()


@pytest.mark.parametrize("observer", [SlidingModeObserver(slopes=(np.inf, 9.0), time_constant=0.01), Oracle()])
def test_spec_with_an_observer_object_survives_json(observer):
    spec = ObserverWrapper(gymnasium.make("SMOPendulum-v0"), observer).spec
    env = gymnasium.make(EnvSpec.from_json(spec.to_json()))
    assert env.get_wrapper_attr("observer") == observer


def test_wrapped_spec_survives_json():
    spec = ObserverWrapper(
        gymnasium.make("SMOPendulum-v0", uncertainty=0.2), "smo", compensation=False, gains="smc"
    ).spec
    env = gymnasium.make(EnvSpec.from_json(spec.to_json()))
    assert json.loads(spec.to_json())["kwargs"] == {"uncertainty": 0.2}
    assert env.get_wrapper_attr("observer").compensation is False
    assert env.unwrapped.task.uncertainty == 0.2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"control_perod": 0.1}, r"unknown environment option 'control_perod': did you mean 'control_period'\?"),
        (
            {"control_period": 0.0015},
            r"control_period=0\.0015 must be a whole multiple of the integration step dt=0\.001",
        ),
        ({"dt": 0.0}, "dt=0.0 must be a finite number greater than 0"),
        ({"horizon": 0.0}, "horizon=0.0 must be a finite number greater than 0"),
        ({"horizon": 0.03}, "horizon=0.03 must be a whole multiple of control_period"),
        ({"uncertainty": 1.0}, r"uncertainty=1\.0 must be a fraction in \[0, 1\)"),
        ({"uncertainty": -0.1}, r"uncertainty=-0\.1 must be a fraction in \[0, 1\)"),
        ({"params": {"cart_mass": -1.0}}, r"cart_mass=-1\.0 must be a finite number greater than 0"),
        ({"params": {"rod_length": -0.4}}, r"rod_length=-0\.4 must be a finite number greater than 0"),
        ({"initial_state": [0.0, 1.0]}, r"initial_state has shape \(2,\)"),
        ({"initial_state": ([1.0] * 4, [0.0] * 4)}, "initial_state has low=.* above high="),
        ({"force_limit": -5.0}, r"force_limit=-5\.0 must be a finite number greater than 0"),
        ({"track_limit": "far"}, "track_limit='far' must be a finite number greater than 0"),
        ({"reward": {"Q": 1}}, r"unknown reward weight 'Q': did you mean 'q'\?"),
        ({"reward": 3}, "reward weight: 3 must be a mapping"),
        ({"uncertainty": "0.1"}, "uncertainty='0.1' must be a finite number"),
        ({"params": {"cart_mass": True}}, "cart_mass=True must be a finite number"),
        ({"preview": -1}, "preview=-1 must be a whole number"),
        ({"initial_state": [[1], [1, 2]]}, "initial_state has shape None"),
        ({"reward": {"r": -1.0}}, "weights of at least 0"),
        ({"render_mode": "opengl"}, "render_mode='opengl'"),
    ],
)
def test_bad_options_are_named(options, message, make_vec):
    with pytest.raises(ValueError, match=message):
        smo_gym.envs.pendulum.PendulumEnv(**options)
    with pytest.raises(ValueError, match=message):
        smo_gym.envs.vector.PendulumVectorEnv(2, **options)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.array([np.nan]), r"action=nan \(slot 0\) must be finite"),
        (np.array([np.inf]), r"action=inf \(slot 0\) must be finite"),
        (np.zeros(2), r"action=.* has shape \(2,\), it must have shape \(1,\)"),
        (np.float64(1.0), r"action=.* has shape \(\), it must have shape \(1,\)"),
    ],
)
def test_bad_actions_are_named(action, message):
    env = gymnasium.make("SMOPendulum-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(action)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stat": [0, 0, 0, 0]}, r"unknown reset option 'stat': did you mean 'state'\?"),
        ({"state": [0, 0, 0]}, r"options\['state'\] has shape \(3,\)"),
        ({"state": [0, np.nan, 0, 0]}, "must be finite"),
        ({"params": {"bob_mass": -1}}, "bob_mass=-1"),
    ],
)
def test_bad_reset_options_are_named(options, message, make_vec):
    for env in (gymnasium.make("SMOPendulum-v0"), make_vec(2)):
        with pytest.raises(ValueError, match=message):
            env.reset(seed=0, options=options)
