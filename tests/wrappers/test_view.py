"""What a learning agent sees: scalar and vector alike, to the bit."""

import gymnasium
import numpy as np
import pytest

from smo_gym.wrappers import ObserverWrapper, VectorObserverWrapper
from smo_gym.wrappers.view import KINDS, LIMIT, UNITS, VectorAgentView, agent_view, scaled, units


def act(k):
    return np.float32(np.sin(0.7 * k))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", ["SMOPendulum-v0", "SMOPendulumTracking-v0"])
def test_the_twins_agree_over_the_end_of_an_episode(kind, env_id, make_vec):
    scalar = agent_view(gymnasium.make(env_id, horizon=0.1), kind)
    vector = VectorAgentView(make_vec(3, env_id, horizon=0.1, autoreset_mode="SameStep"), kind)
    alone, _ = scalar.reset(seed=6)
    batch, _ = vector.reset(seed=5)
    assert alone.dtype == batch.dtype == np.float32
    assert scalar.observation_space == vector.single_observation_space
    assert scalar.action_space == vector.single_action_space
    assert np.array_equal(alone, batch[1])
    for k in range(12):
        alone, reward, _, truncated, info = scalar.step(np.array([act(k)]))
        batch, rewards, _, truncations, infos = vector.step(np.full((3, 1), act(k)))
        last = infos["final_obs"][1] if truncated else batch[1]
        assert np.array_equal(alone, last)
        assert (reward, truncated) == (rewards[1], truncations[1])
        assert scalar.observation_space.contains(alone)
        if truncated:
            assert infos["final_info"]["force"][1] == info["force"] == 30.0 * np.float64(act(k))
            alone, _ = scalar.reset()
            assert np.array_equal(alone, batch[1])


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_frames_begin_anew_in_the_other_modes(mode, make_vec):
    vector = VectorAgentView(make_vec(2, horizon=0.06, autoreset_mode=mode), "stacked")
    vector.reset(seed=0)
    for _ in range(3):
        observation, *_ = vector.step(np.zeros((2, 1)))
    if mode == "NextStep":
        observation, *_ = vector.step(np.zeros((2, 1)))
        assert np.array_equal(observation[:, :-2], observation[:, 2:])
    else:
        before = observation
        observation, _ = vector.reset(options={"reset_mask": np.array([False, True])})
        assert np.array_equal(observation[0], before[0])
        assert np.array_equal(observation[1, :-2], observation[1, 2:])
        assert not np.array_equal(observation[1], before[1])


def test_what_each_kind_tells():
    seen = {}
    for kind in KINDS:
        env = agent_view(gymnasium.make("SMOPendulum-v0"), kind)
        first, _ = env.reset(seed=1)
        for k in range(5):
            seen[kind], _, _, _, info = env.step(np.array([act(k)]))
    truth = (info["state"] / UNITS).astype(np.float32)
    assert np.array_equal(seen["state"], [*truth[:2], *truth])
    assert np.array_equal(seen["positions"], truth[:2])
    assert np.array_equal(seen["stacked"][-2:], truth[:2])
    assert not np.array_equal(seen["stacked"][-4:-2], truth[:2])
    assert len(seen["stacked"]) == 2 * KINDS["stacked"].frames == len(first)
    reference = ObserverWrapper(gymnasium.make("SMOPendulum-v0"), gains="lqr", slopes=(12.5, 12.5), compensation=True)
    reference.reset(seed=1)
    for k in range(5):
        expected, *_ = reference.step(np.array([30.0 * np.float64(act(k))]))
    assert np.array_equal(seen["smo"], (expected / [*UNITS[:2], *UNITS]).astype(np.float32))
    assert not np.array_equal(seen["smo"], seen["smo-uncompensated"])


def test_a_diverged_estimate_is_finite_and_bounded():
    told = scaled(np.array([1.0, -2.0, np.nan, np.inf, -np.inf, 1e9]), units(6))
    assert told.tolist() == [1.0, -2.0, LIMIT, LIMIT, -LIMIT, LIMIT]


def test_bad_input(make_vec):
    with pytest.raises(ValueError, match="unknown observation 'smoo': did you mean 'smo'"):
        agent_view(gymnasium.make("SMOPendulum-v0"), "smoo")
    with pytest.raises(ValueError, match="force_limit=None"):
        agent_view(gymnasium.make("SMOPendulum-v0", force_limit=None))
    with pytest.raises(ValueError, match="force_limit=None"):
        VectorAgentView(make_vec(2, force_limit=None))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("env_id", ["SMOPendulum-v0", "SMOPendulumTracking-v0"])
def test_a_view_stands_next_to_the_plant(kind, env_id, make_vec):
    """With an observer inside it, 'positions' would be no positions alone."""
    with pytest.raises(ValueError, match="an observer or view must stand inside"):
        agent_view(ObserverWrapper(gymnasium.make(env_id)), kind)
    with pytest.raises(ValueError, match="an observer or view must stand inside"):
        VectorAgentView(VectorObserverWrapper(make_vec(2, env_id)), kind)
    with pytest.raises(TypeError, match="is not a smo_gym environment"):
        agent_view(gymnasium.make("Pendulum-v1"), kind)
    with pytest.raises(TypeError, match="is not a smo_gym environment"):
        VectorAgentView(gymnasium.make_vec("Pendulum-v1"), kind)
