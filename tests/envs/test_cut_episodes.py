"""Episodes that end before the horizon, when they are asked to."""

import numpy as np
import pytest

from smo_gym.wrappers.view import VectorAgentView

SHORT = {"horizon": 0.1, "angle_limit": None, "track_limit": None}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_one_episode_may_be_cut_before_the_horizon(make_vec, env_id, mode):
    """The slots end after 2, 5 and 3 steps; until then each goes on as it does uncut, reference and all."""
    made = [make_vec(3, env_id, autoreset_mode=mode, **SHORT) for _ in range(2)]
    cut, whole = (VectorAgentView(env, "stacked") for env in made)
    asked = np.array([2, 5, 3])
    a, b = cut.reset(seed=0, options={"steps": asked})[0], whole.reset(seed=0)[0]
    assert np.array_equal(a, b)
    ends = [[], [], []]
    for k in range(1, 14):
        a, _, terminated, truncated, info = cut.step(np.full((3, 1), 0.1))
        b, *_, other = whole.step(np.full((3, 1), 0.1))
        assert not terminated.any()
        for i in range(3):
            if k < asked[i] or (k == asked[i] and mode != "SameStep"):
                assert np.array_equal(a[i], b[i])
                assert np.array_equal(info.get("desired", a)[i], other.get("desired", b)[i])
            if truncated[i]:
                ends[i].append(k)
                if k == asked[i] == 2 and mode == "SameStep":
                    assert np.array_equal(info["final_obs"][i], b[i])
        if mode == "Disabled" and truncated.any():
            cut.reset(options={"reset_mask": truncated})
    period = 6 if mode == "NextStep" else 5  # later episodes have the horizon
    assert ends == [list(range(first, 14, period)) for first in asked]


def test_where_an_episode_may_be_cut(make_vec):
    env = make_vec(3, horizon=0.1)
    env.reset(seed=0, options={"steps": 1})
    assert env.step(np.zeros((3, 1)))[3].all()
    env.reset(options={"steps": np.array([1, 5, 1]), "reset_mask": np.array([False, True, True])})
    assert env.step(np.zeros((3, 1)))[3].tolist() == [False, False, True]
    for steps in (0, 6, np.array([1, 2, 6]), np.array([1, 2]), 2.0, True, "3", [[1, 1, 1]], None):
        with pytest.raises(ValueError, match=r"options\['steps'\]=.* must be "):
            env.reset(options={"steps": steps})


@pytest.mark.parametrize("options", [{}, {"actuator": "lag"}])
def test_a_partial_reset_tells_of_no_force_in_any_slot(make_vec, options):
    env = make_vec(2, **options)
    env.reset(seed=0)
    env.step(np.ones((2, 1)))
    *_, info = env.reset(options={"reset_mask": np.array([True, False])})
    assert info["asked"].tolist() == info["force"].tolist() == [0.0, 0.0]
