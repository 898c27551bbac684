"""The observer wrappers: what they append and what they refuse. tests/test_envs.py compares scalar with vector."""

import importlib.util
import sys

import gymnasium
import numpy as np
import pytest
from conftest import ROOT

from smo_gym import CartPendulum, ObserverWrapper, Oracle, SlidingModeObserver, VectorObserverWrapper

spec = importlib.util.spec_from_file_location("extremes", ROOT / "benchmarks" / "extremes.py")
extremes = importlib.util.module_from_spec(spec)
sys.modules["extremes"] = extremes  # its dataclass looks its module up
spec.loader.exec_module(extremes)


def test_the_observation_is_measurement_then_estimate(env_id):
    env = ObserverWrapper(gymnasium.make(env_id))
    inner = gymnasium.make(env_id).observation_space.shape[0]
    assert env.observation_space.shape == (inner + 4,)
    observation, info = env.reset(seed=0)
    assert observation.dtype == np.float64
    assert (observation[:2] == info["state"][:2]).all()
    assert (observation[-4:] == 0.0).all()  # nothing is known before the first period
    for _ in range(3):
        observation, *_, info = env.step(np.array([5.0]))
    assert (observation[:2] == info["state"][:2]).all()
    assert (observation[-4:] != 0.0).all()


def test_the_estimate_converges_to_the_true_state():
    gains = {"m1": (4.0, 4.0), "beta_1": (20.0, 20.0), "beta_2": (0.0, 0.0)}
    env = ObserverWrapper(gymnasium.make("SMOPendulum-v0", uncertainty=0.0), gains=gains, slopes=(60.0, 40.0))
    env.reset(options={"state": [0.3, 0.3, 0, 0]})
    for _ in range(300):
        observation, *_, info = env.step(np.zeros(1))
    assert np.abs(observation[2:4] - info["state"][:2]).max() < 0.02
    assert np.abs(observation[4:] - info["state"][2:]).max() < 0.1
    assert np.abs(info["state"][2:]).max() > 0.3  # and there was something to estimate


def test_it_sees_the_force_that_is_applied_not_the_one_that_is_asked_for():
    def run(force):
        env = ObserverWrapper(gymnasium.make("SMOPendulum-v0", force_limit=10.0))
        env.reset(seed=0)
        return env.step(np.array([force]))[0]

    assert (run(10.0) == run(1000.0)).all()


def test_it_works_inside_rescale_action():
    env = gymnasium.wrappers.RescaleAction(ObserverWrapper(gymnasium.make("SMOPendulum-v0")), -1.0, 1.0)
    env.reset(seed=0)
    *_, info = env.step(np.array([0.5]))
    assert info["force"] == pytest.approx(15.0)


def test_the_oracle_is_the_true_state(env_id):
    env = ObserverWrapper(gymnasium.make(env_id), "oracle")
    observation, info = env.reset(seed=0)
    for _ in range(3):
        assert (observation[-4:] == info["state"]).all()
        observation, *_, info = env.step(np.ones(1))


def test_the_oracle_of_a_batch_gives_the_last_state_of_an_episode(make_vec):
    env = VectorObserverWrapper(make_vec(2, autoreset_mode="SameStep", horizon=0.04), "oracle")
    env.reset(seed=0)
    env.step(np.ones((2, 1)))
    observation, *_, info = env.step(np.ones((2, 1)))
    for i in (0, 1):
        assert (info["final_obs"][i][2:] == info["final_info"]["state"][i]).all()
    assert (observation[:, 2:] == info["state"]).all()
    assert (observation[:, :2] == info["state"][:, :2]).all()


@pytest.mark.parametrize("env_id", ["SMOPendulum-v0", "SMOPendulumUpright-v0"])
def test_the_model_is_the_environments_nominal_plant(env_id):
    def estimate(observer, **params):
        env = gymnasium.make(env_id, params=params)
        env = ObserverWrapper(env, observer)
        env.reset(
            options={"state": [0.1, 0.1, 0.0, 0.0], "params": CartPendulum(gravity=env.unwrapped.task.params.gravity)}
        )
        return env.step(np.array([20.0]))[0][-4:]

    nominal = gymnasium.make(env_id, params={"bob_mass": 0.5}).unwrapped.task.params
    for observer in ("smo", SlidingModeObserver()):
        assert (estimate(observer, bob_mass=0.5) == estimate(SlidingModeObserver(model=nominal))).all()
        assert (estimate(observer, bob_mass=0.5) != estimate(observer)).any()


def test_a_limited_force_bounds_the_step():
    settings = {"gains": {"m1": (2, 2), "beta_1": (0, 0), "beta_2": (5.0, 0.0)}, "slopes": (12.0, 30.0)}
    ObserverWrapper(gymnasium.make("SMOPendulum-v0", force_limit=10.0), **settings)
    with pytest.raises(ValueError, match=r"\|u\| up to 30 N"):
        ObserverWrapper(gymnasium.make("SMOPendulum-v0"), **settings)
    with pytest.raises(ValueError, match=r"\|u\| up to 30 N"):
        ObserverWrapper(gymnasium.make("SMOPendulum-v0", force_limit=None), **settings)


def test_refusals(make_vec):
    env = gymnasium.make("SMOPendulum-v0")
    with pytest.raises(ValueError, match=r"unknown observer 'sm': did you mean 'smo'\?"):
        ObserverWrapper(env, "sm")
    with pytest.raises(ValueError, match=r"unknown setting of the observer 'smo' 'slope': did you mean 'slopes'\?"):
        ObserverWrapper(env, slope=(1.0, 1.0))
    with pytest.raises(ValueError, match="gains must not be given beside"):
        ObserverWrapper(env, Oracle(), gains="smc")
    with pytest.raises(ValueError, match="compensation must not be given beside"):
        ObserverWrapper(env, SlidingModeObserver(), compensation=False)
    with pytest.raises(ValueError, match="observers of a sequence have their own settings"):
        VectorObserverWrapper(make_vec(2), [SlidingModeObserver()] * 2, gains="smc")
    for observers in ([SlidingModeObserver()], ["smo", Oracle()]):
        with pytest.raises(ValueError, match="it must have 2 observers, one a slot"):
            VectorObserverWrapper(make_vec(2), observers)
    for env_of_others in (
        gymnasium.make("Pendulum-v1"),
        gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("Pendulum-v1")]),
    ):
        wrapper = ObserverWrapper if isinstance(env_of_others, gymnasium.Env) else VectorObserverWrapper
        with pytest.raises(TypeError, match="is not a smo_gym environment"):
            wrapper(env_of_others)
    with pytest.raises(TypeError, match="observer=None must be one of 'smo', .*'oracle' or an Observer"):
        ObserverWrapper(env, None)
    with pytest.raises(ValueError, match="must stand inside whatever else changes that"):
        ObserverWrapper(ObserverWrapper(env))
    different = [lambda m=m: gymnasium.make("SMOPendulum-v0", params={"bob_mass": m}) for m in (0.1, 0.5)]
    with pytest.raises(ValueError, match="environments with different options"):
        VectorObserverWrapper(gymnasium.vector.SyncVectorEnv(different))


class _Shaken(gymnasium.Wrapper):
    """Noise in what is observed, by a wrapper that does not say that it is one of observations."""

    def step(self, action):
        observation, *rest = self.env.step(action)
        return observation + 0.01, *rest


@pytest.mark.parametrize(
    "change",
    [
        lambda env: gymnasium.wrappers.TransformObservation(env, lambda y: y + 0.5, env.observation_space),
        lambda env: gymnasium.wrappers.DelayObservation(env, 10),
        lambda env: gymnasium.wrappers.OrderEnforcing(gymnasium.wrappers.RescaleObservation(env, -1.0, 1.0)),
    ],
)
def test_measurements_that_an_observer_would_not_see_are_refused(change):
    env = gymnasium.make("SMOPendulum-v0")
    env.unwrapped.observation_space = gymnasium.spaces.Box(-9.0, 9.0, (2,), np.float64)
    with pytest.raises(ValueError, match=r"would not see this\. Noise, quantisation or delay"):
        ObserverWrapper(change(env))


def test_measurements_changed_by_any_wrapper_are_refused_when_they_differ(make_vec):
    env = ObserverWrapper(_Shaken(gymnasium.make("SMOPendulum-v0")))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"observes .* where .* was measured: an observer reads"):
        env.step(np.zeros(1))
    envs = VectorObserverWrapper(
        gymnasium.vector.SyncVectorEnv([lambda: _Shaken(gymnasium.make("SMOPendulum-v0"))] * 2)
    )
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="was measured"):
        envs.step(np.zeros((2, 1)))


def test_noise_in_samples_and_observation_alike_reaches_the_observer():
    class Noisy(gymnasium.Wrapper):
        def step(self, action):
            observation, reward, terminated, truncated, info = self.env.step(action)
            info["samples"] = info["samples"] + 0.1
            return np.concatenate([info["samples"][-1], observation[2:]]), reward, terminated, truncated, info

    estimates = []
    for inner in (lambda env: env, Noisy):
        env = ObserverWrapper(inner(gymnasium.make("SMOPendulum-v0")))
        env.reset(seed=0)
        estimates.append(env.step(np.zeros(1))[0][2:])
    assert (estimates[0] != estimates[1]).any()


def _until_lost(env, state, force):
    """Steps until an estimate is lost, with every observation seen to be in its space."""
    env.reset(seed=0, options={"state": state})
    for _ in range(500):
        observation, _, terminated, _, info = env.step(force)
        assert env.observation_space.contains(observation)
        if np.any(info["estimate_failed"]) or np.all(terminated):
            return observation, info
    raise AssertionError("no estimate was lost")


def test_an_estimate_that_is_lost_starts_anew_and_says_so(make_vec):
    # a spinning rod: h' of the estimate grows with theta'^2, and (35) has no bound for it
    settings = {"beta_1": [0.0, 0.0], "beta_2": [0.0, 0.0], "m1": [2.0, 2.0]}
    state, options = [0.0, 0.0, 0.0, 60.0], {"track_limit": None, "force_limit": None}
    single = ObserverWrapper(gymnasium.make("SMOPendulum-v0", **options), gains=settings, xhat0=[0, 0, 0, 1e160])
    observation, info = _until_lost(single, state, np.zeros(1))
    assert info["estimate_failed"] is True
    assert np.array_equal(observation[2:], [0, 0, 0, 1e160])
    many = VectorObserverWrapper(make_vec(3, **options), gains=settings, xhat0=[0, 0, 0, 1e160])
    observations, infos = _until_lost(many, state, np.zeros((3, 1)))
    assert infos["estimate_failed"].all()
    assert np.array_equal(observations[:, 2:], [[0, 0, 0, 1e160]] * 3)
    _, infos = many.reset()
    assert not infos["estimate_failed"].any()


def test_random_plants_starts_gains_and_forces_never_leave_the_observation_space():
    found = extremes.tried(runs=512, periods=40, seed=0)
    assert found.unflagged == 0
    assert found.lost > 0  # else this shows nothing


def test_a_wrapper_names_its_twin(make_vec):
    with pytest.raises(TypeError, match="is a batch: wrap it in VectorObserverWrapper"):
        ObserverWrapper(make_vec(2))
    with pytest.raises(TypeError, match="is one environment: wrap it in ObserverWrapper"):
        VectorObserverWrapper(gymnasium.make("SMOPendulum-v0"))


def test_nothing_that_is_handed_out_is_the_observers_own_memory(make_vec):
    def episode(meddle):
        env = ObserverWrapper(gymnasium.make("SMOPendulum-v0"))
        observation, info = env.reset(seed=0)
        for _ in range(3):
            if meddle:
                observation[:] = 99.0
                env._estimator.xhat[:] = 99.0
                for value in info.values():
                    if isinstance(value, np.ndarray):
                        value[...] = 99.0
            observation, *_, info = env.step(np.ones(1))
        return observation

    assert np.array_equal(episode(False), episode(True))
