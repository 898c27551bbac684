"""Observers inside of an environment's loop: whose place it is when there are several wrappers around one."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from smo_gym import ObserverWrapper, SlidingModeObserver, VectorObserverWrapper

OBSERVERS = (SlidingModeObserver("lqr"), SlidingModeObserver("smc", xhat0=(0.1, 0.0, 0.0, 0.0)), "oracle")


def episode(env):
    """What an environment observes in an episode from a seed."""
    shape = env.action_space.shape
    found = [env.reset(seed=0)[0]]
    found += [env.step(np.full(shape, 3.0))[0] for _ in range(5)]
    return np.array(found)


def scalar(observer, env=None):
    return ObserverWrapper(env or gymnasium.make("SMOPendulum-v0"), observer)


def vector(observer, env=None):
    return VectorObserverWrapper(env or gymnasium.make_vec("SMOPendulum-v0", 3), observer)


@pytest.mark.parametrize("wrapped", [scalar, vector])
def test_each_wrapper_around_one_environment_gives_its_own_estimates_from_its_reset_on(wrapped):
    env = wrapped("oracle").env
    several = [wrapped(observer, env) for observer in OBSERVERS]
    for _ in range(2):
        for observer, mine in zip(OBSERVERS, several, strict=True):
            assert np.array_equal(episode(mine), episode(wrapped(observer)))


@pytest.mark.parametrize("wrapped", [scalar, vector])
def test_a_wrapper_whose_place_another_one_took_says_so(wrapped):
    first = wrapped(OBSERVERS[0])
    episode(first)
    second = wrapped(OBSERVERS[1], first.env)
    with pytest.raises(ResetNeeded, match="another observer was put around this environment"):
        first.step(np.zeros(first.action_space.shape))
    episode(second)
    episode(first)
    first.step(np.zeros(first.action_space.shape))
