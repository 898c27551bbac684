"""The native vector environments: against scalar ones bit for bit, autoreset, copies, processes, refusals."""

import copy
import pickle
from functools import partial

import gymnasium
import numpy as np
import pytest
from conftest import assert_same
from gymnasium.error import ResetNeeded
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

import smo_gym
from smo_gym import ObserverWrapper, VectorObserverWrapper
from smo_gym.envs.task import Reward


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


def test_bad_actions_of_a_batch_name_the_slot(make_vec):
    env = make_vec(3)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros((3, 1)))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"slot 2"):
        env.step(np.array([[0.0], [1.0], [np.nan]]))
    with pytest.raises(ValueError, match=r"action has shape \(3,\), it must have shape \(3, 1\)"):
        env.step(np.zeros(3))


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
    with pytest.raises(ValueError, match=r"seed=\[1, 2, 3\] must be None, a whole number, or 2 of these"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="num_envs=0 must be a positive integer"):
        make_vec(0)


def test_max_episode_steps_ends_the_episodes_as_in_gymnasiums_own(make_vec):
    env = make_vec(2, max_episode_steps=3)
    env.reset(seed=0)
    assert [env.step(np.zeros((2, 1)))[3].tolist() for _ in range(3)] == [[False] * 2] * 2 + [[True] * 2]
    assert env.spec.max_episode_steps == 3
    assert make_vec(2, max_episode_steps=10**6).spec.max_episode_steps == 1750  # the horizon ends it first
    with pytest.raises(ValueError, match="max_episode_steps=0 must be a positive integer"):
        make_vec(2, max_episode_steps=0)


def test_a_spec_tells_the_length_of_an_episode_and_survives_json():
    options = {
        "initial_state": np.zeros(4),
        "params": smo_gym.CartPendulum(cart_mass=2.0),
        "horizon": np.float64(2.0),
        "reward": Reward(r=0.0),
    }
    env = gymnasium.make("SMOPendulum-v0", **options)
    assert env.spec.max_episode_steps == 100
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.task == env.unwrapped.task
    envs = gymnasium.make_vec("SMOPendulum-v0", 2, autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP, **options)
    assert envs.spec.max_episode_steps == 100
    again = gymnasium.make_vec(gymnasium.envs.registration.EnvSpec.from_json(envs.spec.to_json()))
    assert again.unwrapped.task == envs.unwrapped.task
    assert again.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    wrapped = smo_gym.ObserverWrapper(env, gains={name: np.ones(2) for name in ("m1", "beta_1", "beta_2")})
    gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(wrapped.spec.to_json()))


def test_the_action_of_an_ended_slot_does_not_stop_the_batch(make_vec):
    for mode in ("NextStep", "Disabled"):
        env = make_vec(2, autoreset_mode=mode, track_limit=1.0)
        env.reset(options={"state": np.array([[0.999, 0, 50.0, 0], [0, 0, 0, 0]])})
        _, _, terminated, _, _ = env.step(np.zeros((2, 1)))
        assert terminated.tolist() == [True, False]
        env.step(np.array([[np.nan], [1.0]]))
    env.reset(options={"state": np.zeros(4)})
    with pytest.raises(ValueError, match=r"action=nan \(slot 1\) must be finite"):
        env.step(np.array([[0.0], [np.nan]]))


@pytest.mark.parametrize(
    "bad",
    [
        {"options": {"state": [np.nan] * 4}},
        {"options": {"params": {"cart_mas": 1.0}}},
        {"seed": 7, "options": {"params": {"cart_mas": 1.0}}},
        {"seed": 7, "options": {"steps": 0}},
        {"seed": -7},
        {"seed": [1, "2"]},
        {"seed": "ab"},
    ],
)
def test_a_reset_that_raised_changes_nothing(make_vec, bad):
    def episode(fail):
        env = make_vec(2)
        if fail:
            with pytest.raises((ValueError, gymnasium.error.Error)):
                env.reset(**bad)
            with pytest.raises(ResetNeeded):
                env.step(np.zeros((2, 1)))
        env.reset(seed=np.int64(0))
        env.step(np.ones((2, 1)))
        if fail:
            with pytest.raises((ValueError, gymnasium.error.Error)):
                env.reset(**bad)
        assert env.np_random_seed == (0, 1)
        return env.step(np.ones((2, 1)))[0], env.reset()[0]

    for a, b in zip(episode(False), episode(True), strict=True):
        assert np.array_equal(a, b)


def test_a_scalar_reset_that_raised_changes_nothing():
    env = gymnasium.make("SMOPendulum-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"options\['state'\]"):
        env.reset(seed=7, options={"state": [np.nan] * 4})
    other = gymnasium.make("SMOPendulum-v0").unwrapped
    other.reset(seed=0)
    assert np.array_equal(env.step(np.ones(1))[0], other.step(np.ones(1))[0])
    assert np.array_equal(env.reset()[0], other.reset()[0])


def test_an_action_of_another_type_is_named(make_vec):
    env = make_vec(2)
    env.reset()
    single = gymnasium.make("SMOPendulum-v0").unwrapped
    single.reset()
    for action in ("abc", [[1j], [0]], [["a"], ["b"]], {}, [[1.0], [2.0, 3.0]], None):
        with pytest.raises(ValueError, match="action"):
            env.step(action)
        with pytest.raises(ValueError, match="action"):
            single.step(action)
