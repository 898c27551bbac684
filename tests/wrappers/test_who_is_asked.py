"""Whoever changes what is measured, estimated or done is heard, also where a compiled part would be at hand."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from smo_gym import LQR, ObserverWrapper, Oracle, SlidingModeObserver, VectorObserverWrapper
from smo_gym.envs.pendulum import PendulumEnv
from smo_gym.evaluation import rollout
from smo_gym.wrappers.view import VectorAgentView

K = [7.0, -4.0, 11.0, -1.0]


class Off(LQR):
    """A law that is a law no more."""

    def predict(self, observation, *state, **more):
        return np.zeros((len(observation), 1)), None


class Limited:
    """A law behind another object."""

    def __init__(self, law):
        self._law = law

    def __getattr__(self, name):
        return getattr(self._law, name)

    def predict(self, *args, **more):
        force, state = self._law.predict(*args, **more)
        return np.clip(force, -1.0, 1.0), state


class Blind(VectorObserverWrapper):
    """An observer that tells nothing."""

    def step(self, actions):
        observation, *rest = super().step(actions)
        observation[:, 2:] = 0.0
        return observation, *rest


class Sevens:
    def __init__(self, n):
        self.xhat = np.full((4, n), 7.0)

    def reset(self, slots, y):
        pass

    def update(self, samples, u):
        pass


class Mine(SlidingModeObserver):
    def start(self, n, dt, force, nominal):
        return Sevens(n)


class Shifted(PendulumEnv):
    """Encoders that are off by one, as an environment of its own."""

    def step(self, action):
        observation, *rest, info = super().step(action)
        info["samples"] = info["samples"] + 1.0
        return observation + 1.0, *rest, info


def run(make_vec, agent, wrapper=VectorObserverWrapper):
    env = wrapper(make_vec(2, autoreset_mode="Disabled", horizon=1.0))
    return rollout(env, agent, seed=0).metrics


def test_a_law_that_overrides_predict_is_asked(make_vec):
    assert (run(make_vec, LQR(K))["effort"] > 0.0).all()
    assert (run(make_vec, Off(K))["effort"] == 0.0).all()
    assert (run(make_vec, Limited(LQR(K)))["peak_force"] <= 1.0).all()


def test_a_wrapper_that_overrides_step_is_heard(make_vec):
    told, blind = (run(make_vec, LQR(K), wrapper)["effort"] for wrapper in (VectorObserverWrapper, Blind))
    assert (told != blind).all()


def test_an_observer_that_overrides_start_is_started(make_vec):
    observation, _ = ObserverWrapper(gymnasium.make("SMOPendulum-v0"), Mine()).reset(seed=0)
    assert (observation[2:] == 7.0).all()


def test_an_environment_that_overrides_step_is_measured():
    env = ObserverWrapper(Shifted(initial_state=[0.0] * 4, force_limit=None))
    env.reset(seed=0)
    for _ in range(100):
        observation, *_ = env.step(np.zeros(1))
    np.testing.assert_allclose(observation[:4], 1.0, atol=0.02)


def test_a_maximum_over_frames_is_no_measurement():
    env = ObserverWrapper(gymnasium.wrappers.MaxAndSkipObservation(gymnasium.make("SMOPendulum-v0"), skip=2))
    env.reset(seed=3)

    def act():
        for _ in range(200):
            env.step(np.ones(1))

    with pytest.raises(ValueError, match="was measured"):
        act()


@pytest.mark.parametrize("some", [Oracle(), SlidingModeObserver()])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_the_oracle_sees_the_truth_in_every_kind_of_batch(make_vec, some, mode):
    observers = [Oracle(), some, Oracle()]
    mode = gymnasium.vector.AutoresetMode(mode)
    alone = lambda: gymnasium.make("SMOPendulum-v0", horizon=0.2)  # noqa: E731
    batches = [
        VectorObserverWrapper(make_vec(3, horizon=0.2, autoreset_mode=mode), observers),
        VectorObserverWrapper(gymnasium.vector.SyncVectorEnv([alone] * 3, autoreset_mode=mode), observers),
    ]
    first = [batch.reset(seed=0)[0] for batch in batches]
    assert (first[0] == first[1]).all()
    for _ in range(25):
        told = [batch.step(np.full((3, 1), 5.0))[0] for batch in batches]
        assert (told[0] == told[1]).all()


@pytest.mark.parametrize("wrapper", [VectorObserverWrapper, partial(VectorAgentView, observation="stacked")])
def test_part_of_gymnasiums_own_batch_starts_anew_as_part_of_ours(make_vec, wrapper):
    mode = gymnasium.vector.AutoresetMode.DISABLED
    single = partial(gymnasium.make, "SMOPendulum-v0")
    ours = make_vec(3, autoreset_mode=mode)
    batches = [wrapper(env) for env in (ours, gymnasium.vector.SyncVectorEnv([single] * 3, autoreset_mode=mode))]
    for batch in batches:
        batch.reset(seed=0)
        batch.step(np.full((3, 1), 0.5))
    told = [batch.reset(options={"reset_mask": np.array([True, False, False])})[0] for batch in batches]
    for _ in range(3):
        assert (told[0] == told[1]).all()
        told = [batch.step(np.full((3, 1), 0.5))[0] for batch in batches]


def test_an_agent_that_is_to_see_the_state_sees_it_in_subprocesses_and_loops():
    told = []
    for mode in ("vector_entry_point", "sync"):
        view = VectorAgentView(gymnasium.make_vec("SMOPendulum-v0", 2, vectorization_mode=mode), "state")
        view.reset(seed=0)
        for _ in range(5):
            observation, *_ = view.step(np.full((2, 1), 0.2))
        told.append(observation)
    assert (told[0] == told[1]).all()


def test_part_of_a_batch_is_not_started_by_a_displaced_observer(make_vec):
    env = make_vec(2, autoreset_mode="Disabled")
    first = VectorObserverWrapper(env)
    first.reset(seed=0)
    VectorObserverWrapper(env, "oracle").reset(seed=0)
    with pytest.raises(ResetNeeded, match="of all slots"):
        first.reset(options={"reset_mask": np.array([True, False])})


def test_a_law_whose_gain_changes_is_another_law():
    law, observation = LQR([1.0, 0.0, 0.0, 0.0], wrap=False), np.ones(6)
    assert law.predict(observation)[0] == -1.0
    law.K = np.array([[5.0, 0.0, 0.0, 0.0]])
    assert law.predict(observation)[0] == -5.0
    law = LQR([1.0, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="read-only"):
        law.K[0, 0] = 2.0


def test_what_is_measured_and_what_is_true_are_two_arrays():
    _, info = gymnasium.make("SMOPendulum-v0").reset(seed=0)
    info["samples"] += 1.0
    assert (info["positions"][-1] == info["state"][:2]).all()
