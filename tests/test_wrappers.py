"""The observer wrappers: what they append and what they refuse. tests/test_envs.py compares scalar with vector."""

import gymnasium
import numpy as np
import pytest

from smo_gym import CartPendulum, ObserverWrapper, Oracle, SlidingModeObserver, VectorObserverWrapper


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
    for observers in ([SlidingModeObserver()], [Oracle()] * 2):
        with pytest.raises(ValueError, match="it must have 2 SlidingModeObserver, one a slot"):
            VectorObserverWrapper(make_vec(2), observers)
    for env_of_others in (
        gymnasium.make("Pendulum-v1"),
        gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("Pendulum-v1")]),
    ):
        wrapper = ObserverWrapper if isinstance(env_of_others, gymnasium.Env) else VectorObserverWrapper
        with pytest.raises(TypeError, match="is not a smo_gym environment"):
            wrapper(env_of_others)
    with pytest.raises(TypeError, match="observer=None must be one of 'smo', 'oracle' or an Observer"):
        ObserverWrapper(env, None)
    with pytest.raises(ValueError, match="must stand inside whatever else changes that"):
        ObserverWrapper(ObserverWrapper(env))
    different = [lambda m=m: gymnasium.make("SMOPendulum-v0", params={"bob_mass": m}) for m in (0.1, 0.5)]
    with pytest.raises(ValueError, match="environments with different options"):
        VectorObserverWrapper(gymnasium.vector.SyncVectorEnv(different))


def test_the_measurement_comes_from_the_encoders_whatever_stands_between():
    env = gymnasium.make("SMOPendulum-v0")
    scaled = gymnasium.wrappers.TransformObservation(env, lambda y: 10.0 * y, env.observation_space)
    estimates = []
    for inner in (env, scaled):
        wrapped = ObserverWrapper(inner)
        wrapped.reset(seed=0)
        estimates.append([wrapped.step(np.ones(1))[0][2:] for _ in range(3)])
    assert np.array_equal(*estimates)
