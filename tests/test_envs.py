"""The environments: Gymnasium's own checks, scalar against vector, the end of an episode, refusals."""

import copy
import json
import pickle
import warnings
from functools import partial

import gymnasium
import numpy as np
import pytest
from conftest import IDS, assert_same
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

import smo_gym
from smo_gym import CartPendulum, ObserverWrapper, Oracle, SlidingModeObserver, VectorObserverWrapper

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
    keys = {"state", "params", "force", "samples"} | ({"desired"} if "Tracking" in env_id else set())
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
    assert not np.isfinite(info["state"]).all()
    assert reward == -100.0


def test_the_horizon_truncates():
    env = gymnasium.make("SMOPendulum-v0", horizon=0.1)
    env.reset(seed=0)
    flags = [env.step(np.zeros(1))[2:4] for _ in range(5)]
    assert flags == [(False, False)] * 4 + [(False, True)]


def scalar_batch(id, n, mode, **options):
    return SyncVectorEnv([lambda: gymnasium.make(id, **options)] * n, autoreset_mode=mode)


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("n", [1, 5])
def test_vector_and_scalar_agree_to_the_bit_through_many_episodes(env_id, make_vec, n, mode, wrapped):
    options = {"horizon": 1.0, "track_limit": 1.05, "initial_state": ([-1, -0.2, -1, -1], [1, 0.2, 1, 1])}
    native = make_vec(n, env_id, autoreset_mode=mode, **options)
    twin = scalar_batch(env_id, n, mode, **options)
    if wrapped:
        native, twin = VectorObserverWrapper(native), VectorObserverWrapper(twin)
    a, b = native.reset(seed=11), twin.reset(seed=11)
    rng = np.random.default_rng(0)
    ends = np.zeros(2)
    for _ in range(250):
        assert_same(dict(enumerate(a)), dict(enumerate(b)))
        actions = rng.uniform(-40, 40, (n, 1))
        a, b = native.step(actions), twin.step(actions)
        ends += [a[2].sum(), a[3].sum()]
    assert ends.sum() > 2
    assert n == 1 or (ends > 0).all()  # both kinds of end were met


def test_the_vector_wrapper_does_what_scalar_wrappers_do(env_id, make_vec):
    options = {"horizon": 0.6, "initial_state": ([-1, -0.2, -1, -1], [1, 0.2, 1, 1])}
    native = VectorObserverWrapper(make_vec(3, env_id, **options), gains="smc", compensation=False)
    twin = SyncVectorEnv(
        [lambda: ObserverWrapper(gymnasium.make(env_id, **options), gains="smc", compensation=False)] * 3
    )
    assert native.observation_space == twin.observation_space
    a, b = native.reset(seed=2), twin.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(70):
        assert_same(dict(enumerate(a)), dict(enumerate(b)))
        actions = rng.uniform(-30, 30, (3, 1))
        a, b = native.step(actions), twin.step(actions)


def test_disabled_autoreset_holds_an_ended_slot_until_it_is_reset(make_vec):
    env = VectorObserverWrapper(make_vec(3, autoreset_mode="Disabled", horizon=0.1))
    env.reset(seed=0, options={"state": np.array([[0, 0, 0, 0], [5.0, 0, 1, 0], [0, 1, 0, 0]], dtype=float)})
    _, reward, terminated, _, info = env.step(np.ones((3, 1)))
    assert terminated.tolist() == [False, True, False]
    held = info["state"][1]
    _, reward, terminated, _truncated, info = env.step(np.ones((3, 1)))
    assert terminated.tolist() == [False, True, False]
    assert (info["state"][1] == held).all()
    assert reward[1] == info["force"][1] == 0.0
    assert (info["samples"][1] == held[:2]).all()
    observation, info = env.reset(seed=[None, 7, None], options={"reset_mask": np.array([False, True, False])})
    assert (observation[1, 2:] == 0.0).all()
    assert (observation[[0, 2], 2:] != 0.0).any()
    scalar, _ = gymnasium.make("SMOPendulum-v0").reset(seed=7)
    assert (observation[1, :2] == scalar).all()
    flags = [env.step(np.ones((3, 1)))[2:4] for _ in range(3)]
    assert flags[-1][1].tolist() == [True, False, True]  # its clock started anew, the others' went on
    assert not flags[-1][0].any()


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


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("n", [1, 3])
def test_what_a_step_returned_is_not_written_to_again(make_vec, n, wrapped):
    env = make_vec(n, horizon=0.1)
    env = VectorObserverWrapper(env) if wrapped else env
    kept, copies = [env.reset(seed=0)], []
    for _ in range(12):
        copies.append(copy.deepcopy(kept[-1]))
        kept.append(env.step(np.full((n, 1), 9.0)))
    for a, b in zip(kept, copies, strict=False):
        assert_same(dict(enumerate(a)), dict(enumerate(b)))


def test_vector_options_are_for_all_slots_or_one_each(make_vec):
    env = make_vec(2)
    states = np.array([[0.1, 0.2, 0.3, 0.4], [-0.1, -0.2, -0.3, -0.4]])
    plants = np.array([[3.0, 0.3, 0.4, -9.8], [4.0, 0.4, 0.5, -9.8]])
    _, info = env.reset(seed=0, options={"state": states, "params": plants})
    assert (info["state"] == states).all()
    assert (info["params"] == plants).all()
    _, info = env.reset(options={"state": states[0], "params": {"bob_mass": 0.7}})
    assert (info["state"] == states[0]).all()
    assert (info["params"] == [3.5, 0.7, 0.44, -9.8]).all()


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_subprocesses_give_the_same_bits(make_vec, context, env_id):
    native = VectorObserverWrapper(make_vec(2, env_id))
    workers = AsyncVectorEnv([partial(gymnasium.make, f"smo_gym:{env_id}")] * 2, context=context)
    twin = VectorObserverWrapper(workers)
    a, b = native.reset(seed=3), twin.reset(seed=3)
    for _ in range(5):
        assert_same(dict(enumerate(a)), dict(enumerate(b)))
        a, b = native.step(np.ones((2, 1))), twin.step(np.ones((2, 1)))
    workers.close()


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_alike(make_vec, duplicate):
    for env, action in (
        (ObserverWrapper(gymnasium.make("SMOPendulum-v0")), np.ones(1)),
        (VectorObserverWrapper(make_vec(3, horizon=0.1)), np.ones((3, 1))),
    ):
        env.reset(seed=0)
        env.step(action)
        twin = duplicate(env)
        for _ in range(6):
            assert_same(dict(enumerate(env.step(action))), dict(enumerate(twin.step(action))))


def test_gymnasiums_wrappers_stand_around_ours(make_vec):
    env = gymnasium.wrappers.TimeLimit(ObserverWrapper(gymnasium.make("SMOPendulum-v0")), 3)
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env.reset(seed=0)
    steps = [env.step(np.zeros(1)) for _ in range(3)]
    assert steps[-1][3]
    assert steps[-1][4]["episode"]["l"] == 3
    batch = gymnasium.wrappers.vector.RecordEpisodeStatistics(VectorObserverWrapper(make_vec(2, horizon=0.06)))
    batch.reset(seed=0)
    infos = [batch.step(np.zeros((2, 1)))[4] for _ in range(3)]
    assert infos[-1]["episode"]["l"].tolist() == [3, 3]


def test_one_seed_gives_one_result_whatever_the_number_of_slots(make_vec):
    def run(n):
        env = VectorObserverWrapper(make_vec(n))
        env.reset(seed=4)
        return [env.step(np.full((n, 1), 3.0))[0][:3] for _ in range(20)]

    assert np.array_equal(run(3), run(200))


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


def test_bad_actions_of_a_batch_name_the_slot(make_vec):
    env = make_vec(3)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros((3, 1)))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"slot 2"):
        env.step(np.array([[0.0], [1.0], [np.nan]]))
    with pytest.raises(ValueError, match=r"action has shape \(3,\), it must have shape \(3, 1\)"):
        env.step(np.zeros(3))


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


def test_a_first_reset_that_fails_leaves_nothing_behind(make_vec):
    env = make_vec(2)
    with pytest.raises(ResetNeeded, match="first reset"):
        env.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(gymnasium.error.Error):
        env.reset(seed=[-1, 2])
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(np.zeros((2, 1)))
    env.reset(seed=0)
    env.step(np.zeros((2, 1)))


def test_bad_masks_and_seeds_are_named(make_vec):
    env = make_vec(2)
    env.reset(seed=0)
    for mask in ([True, False], np.array([True]), np.array([1, 0])):
        with pytest.raises(ValueError, match=r"reset_mask.* must be a boolean array of shape \(2,\)"):
            env.reset(options={"reset_mask": mask})
    with pytest.raises(ValueError, match="at least one slot"):
        env.reset(options={"reset_mask": np.zeros(2, dtype=bool)})
    with pytest.raises(ValueError, match="seed has 3 entries for 2 slots"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="num_envs=0 must be a positive integer"):
        make_vec(0)
