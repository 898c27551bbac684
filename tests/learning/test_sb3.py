"""Stable-Baselines3 on the native batch."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecMonitor, is_vecenv_wrapped

from smo_gym import VectorObserverWrapper
from smo_gym.learning.sb3 import SB3VecEnv
from smo_gym.wrappers.view import VectorAgentView, agent_view

OPTIONS = {"horizon": 0.2, "track_limit": 0.9}  # some episodes begin off the track, the others end at the horizon


@pytest.fixture
def make(make_vec):
    def make(n, **options):
        return SB3VecEnv(VectorAgentView(make_vec(n, autoreset_mode="SameStep", **{**OPTIONS, **options})))

    return make


def test_it_is_the_plain_route_step_by_step(make):
    ours = make(4)
    plain = make_vec_env("SMOPendulum-v0", 4, wrapper_class=agent_view, env_kwargs={**OPTIONS, "render_mode": None})
    for env in (ours, plain):
        env.seed(3)
    a, b = ours.reset(), plain.reset()
    assert np.array_equal(a, b)
    assert a.dtype == b.dtype == np.float32
    assert ours.observation_space == plain.observation_space
    assert ours.action_space == plain.action_space
    rng, truncations = np.random.default_rng(0), []
    for _ in range(60):
        action = rng.uniform(-1.0, 1.0, (4, 1)).astype(np.float32)
        (a, r, done, infos), (b, s, over, others) = ours.step(action), plain.step(action)
        assert np.array_equal(a, b)
        assert np.array_equal(r, s)
        assert np.array_equal(done, over)
        for info, other in zip(infos, others, strict=True):
            assert ("terminal_observation" in info) == ("terminal_observation" in other)
            if "terminal_observation" in info:
                assert np.array_equal(info["terminal_observation"], other["terminal_observation"])
                assert info["TimeLimit.truncated"] == other["TimeLimit.truncated"]
                truncations.append(info["TimeLimit.truncated"])
    assert any(truncations)
    assert not all(truncations)


def test_monitor_counts_episodes(make):
    env = VecMonitor(make(3, track_limit=None))
    env.reset()
    total = np.zeros(3)
    for _ in range(10):
        _, reward, done, infos = env.step(np.zeros((3, 1), dtype=np.float32))
        total += reward
    assert done.all()
    assert [info["episode"]["l"] for info in infos] == [10, 10, 10]
    assert np.allclose([info["episode"]["r"] for info in infos], total, atol=1e-5)


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        (PPO, {"n_steps": 16, "batch_size": 32, "n_epochs": 1}),
        (SAC, {"learning_starts": 16, "batch_size": 16, "buffer_size": 100}),
    ],
)
def test_algorithms_learn_on_it(algorithm, settings, make):
    model = algorithm("MlpPolicy", VecMonitor(make(4)), seed=0, device="cpu", **settings)
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(64)
    assert model.num_timesteps >= 64
    assert any((p != q).any() for p, q in zip(before, model.policy.parameters(), strict=True))
    assert len(model.ep_info_buffer) > 0


def test_seeds_and_options_hold_for_one_reset(make):
    env = make(3)
    env.seed(7)
    first = env.reset()
    assert not np.array_equal(env.reset(), first)
    env.seed(7)
    assert np.array_equal(env.reset(), first)
    env.set_options({"state": [0.5, 0.25, 0.0, 0.0]})
    assert np.array_equal(env.reset()[:, :2], np.tile(np.float32([0.5, 0.25]), (3, 1)))
    env.set_options([{"state": [0.1 * i, 0.0, 0.0, 0.0]} for i in range(3)])
    assert np.allclose(env.reset()[:, 0], [0.0, 0.1, 0.2])
    plant = {"cart_mass": 3.0}
    env.set_options({"params": plant})
    env.reset()
    assert env.vector_info["params"][:, 0].tolist() == [3.0] * 3
    env.set_options([{"params": plant, "steps": 1 + i} for i in range(3)])
    env.reset()
    ended = np.stack([env.step(np.zeros((3, 1), dtype=np.float32))[2] for _ in range(3)])
    assert np.array_equal(ended, np.eye(3, dtype=bool))
    env.set_options([{"state": [0.0] * 4}, {}, {}])
    with pytest.raises(ValueError, match="every slot"):
        env.reset()


def test_attributes_and_methods(make):
    env = make(3)
    env.reset()
    assert env.get_attr("render_mode") == [None] * 3
    assert env.get_attr("task", indices=[0, 2])[0].horizon == 0.2
    generators = env.get_attr("np_random", 1)
    assert generators == [env.env.unwrapped.np_random[1]]
    env.set_attr("metadata", {"a": 1})
    assert env.get_attr("metadata") == [{"a": 1}] * 3
    for indices in ([1], [5], 0):
        with pytest.raises(ValueError, match=r"set_attr\('metadata', indices=.*name all 3 or none"):
            env.set_attr("metadata", {}, indices=indices)
        with pytest.raises(ValueError, match=r"env_method\('reset', indices=.*name all 3 or none"):
            env.env_method("reset", indices=indices)
    with pytest.raises(AttributeError):
        env.get_attr("nothing")
    assert not env.has_attr("nothing")
    assert [result[0].shape for result in env.env_method("reset", indices=[2, 0, 1])] == [(3, 6)] * 3
    assert env.env_is_wrapped(VectorObserverWrapper, [0, 1]) == [True, True]
    assert env.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    assert is_vecenv_wrapped(VecMonitor(env), VecMonitor)
    env.close()


def test_another_autoreset_mode_is_refused(make_vec):
    with pytest.raises(ValueError, match="SameStep"):
        SB3VecEnv(VectorAgentView(make_vec(2)))
