"""Sensors, actuators, friction and disturbances in the environments: the same bits however they are run."""

import math
import pickle
import warnings
from dataclasses import fields

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from smo_gym import LQR, ObserverWrapper, VectorObserverWrapper, presets
from smo_gym.actuators import Actuator
from smo_gym.disturbances import Disturbance
from smo_gym.evaluation import rollout
from smo_gym.friction import Friction
from smo_gym.observers import SlidingModeObserver
from smo_gym.policies import shipped
from smo_gym.sensors import Sensor
from smo_gym.validation import unknown

IDS = ("SMOPendulum-v0", "SMOPendulumUpright-v0", "SMOPendulumTracking-v0")
ROUGH = {
    "sensor": {
        "noise": (1e-3, 2e-3),
        "resolution": (1e-4, 1e-3),
        "delay": (3, 5),
        "dropout": (0.1, 0.1),
        "jitter": 1e-4,
    },
    "actuator": {"time_constant": 0.01, "dead_zone": 0.1, "back_emf": 2.0, "delay": 2, "rate_limit": 500.0},
    "disturbance": [
        {"kind": "noise", "force": 1.0, "bandwidth": 5.0},
        {"kind": "step", "force": (-1.0, 1.0), "torque": 0.01, "start": (0.0, 0.1)},
    ],
    "friction": {"cart_viscous": 0.5, "cart_coulomb": 0.3, "pivot_viscous": 0.002},
    "friction_uncertainty": 0.3,
}


def equal(one, other):
    """Whether two infos or observations are the same to the bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    return np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("options", [ROUGH, *({key: value} for key, value in ROUGH.items())])
def test_gymnasium_finds_nothing(name, options):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(infinity|symmetric and normalized space)")  # as in test_envs.py
        check_env(gymnasium.make(name, disable_env_checker=True, **options).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", IDS)
def test_a_slot_has_the_bits_of_a_scalar_environment(name):
    env = gymnasium.make_vec(name, 5, **ROUGH)
    observation, info = env.reset(seed=7)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-5.0, 5.0, (15, 5, 1))
    many = [(observation, info), *((step[0], step[4]) for step in map(env.step, actions))]
    for i in range(5):
        one = gymnasium.make(name, **ROUGH)
        alone = [one.reset(seed=7 + i), *((step[0], step[4]) for step in map(one.step, actions[:, i]))]
        for (there, all_told), (here, told) in zip(many, alone, strict=True):
            assert equal(there[i], here)
            assert equal({key: all_told[key][i] for key in told}, told)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_episodes_that_begin_later_are_those_of_any_mode(mode):
    options = {**ROUGH, "horizon": 0.2}
    env = gymnasium.make_vec("SMOPendulum-v0", 3, autoreset_mode=mode, **options)
    env.reset(seed=3)
    found = []
    while len(found) < 2:
        observation, *_, info = env.step(np.ones((3, 1)))
        if (env.unwrapped._k == 0).all() or (mode is AutoresetMode.DISABLED and env.unwrapped._waiting):
            if mode is AutoresetMode.DISABLED:
                observation, info = env.reset(options={"reset_mask": np.ones(3, dtype=np.bool_)})
            found.append((observation, info["params"], info["friction"]))
    one = gymnasium.make("SMOPendulum-v0", **options)
    one.reset(seed=4)
    for observation, params, friction in found:
        here, told = one.reset()
        assert equal(observation[1], here)
        assert equal(params[1], told["params"])
        assert equal(friction[1], told["friction"])


def test_an_episode_is_replayed_by_its_state_plant_and_noise():
    env = gymnasium.make("SMOPendulum-v0", **ROUGH)
    case = {"state": [0.1, 0.2, 0.0, 0.0], "params": [3.0, 0.3, 0.4, -9.8], "noise": 12}

    def run(seed, options):
        first, _ = env.reset(seed=seed, options=options)
        return np.array([first, *(env.step(np.array([1.0]))[0] for _ in range(20))])

    assert equal(run(0, case), run(1, case))
    assert not equal(run(0, case), run(0, {**case, "noise": 13}))


def test_samples_are_measured_and_positions_true():
    env = gymnasium.make("SMOPendulum-v0", sensor={"bias": (0.5, -0.25)}, initial_state=[0.1, 0.2, 0.0, 0.0])
    observation, info = env.reset(seed=0)
    np.testing.assert_allclose(observation, [0.6, -0.05], atol=1e-15)
    for _ in range(3):
        np.testing.assert_allclose(info["samples"] - info["positions"], [[0.5, -0.25]] * 20, atol=1e-15)
        assert equal(observation, info["samples"][-1])
        assert equal(info["state"][:2], info["positions"][-1])
        observation, _, _, _, info = env.step(np.array([2.0]))


def test_the_force_that_reaches_the_cart_stands_beside_the_one_that_was_asked_for():
    env = gymnasium.make("SMOPendulum-v0", actuator={"time_constant": 0.02}, control_period=0.02)
    env.reset(seed=0)
    *_, info = env.step(np.array([40.0]))
    assert info["asked"] == 30.0
    np.testing.assert_allclose(info["force"], 30.0 * np.exp(-1.0), rtol=1e-12)  # the mean of a first-order lag's start


def test_commands_have_their_own_unit():
    volts = gymnasium.make("SMOPendulum-v0", actuator={"unit": 3.0})
    newtons = gymnasium.make("SMOPendulum-v0")
    assert volts.action_space.high.item() == 10.0
    for env in (volts, newtons):
        env.reset(seed=0)
    assert volts.step(np.array([2.0]))[4]["asked"] == newtons.step(np.array([6.0]))[4]["asked"] == 6.0


@pytest.mark.parametrize("agent", [LQR((5.0, -3.0, 8.0, -1.0)), shipped("SMOPendulum-v0")])
def test_agents_say_newtons_whatever_the_unit_of_commands(agent):
    def run(unit):
        options = {"autoreset_mode": "Disabled", "horizon": 2.0, "actuator": {"unit": unit}}
        return rollout(VectorObserverWrapper(gymnasium.make_vec("SMOPendulum-v0", 3, **options)), agent, seed=0)

    assert equal(run(1.0).metrics, run(4.0).metrics)


@pytest.mark.parametrize("measured", [False, True])
def test_both_drivers_give_the_same_bits(measured):
    options = {**ROUGH, "actuator": {**ROUGH["actuator"], "measured": measured}, "horizon": 1.0}
    law = LQR((5.0, -3.0, 8.0, -1.0))

    class Asked:
        def predict(self, *told):
            return law.predict(*told)

    def run(agent):
        env = gymnasium.make_vec("SMOPendulum-v0", 6, autoreset_mode="Disabled", control_period=0.005, **options)
        return rollout(VectorObserverWrapper(env), agent, seed=1)

    assert equal(run(law).metrics, run(Asked()).metrics)


class Outside:
    """The same observer without its block."""

    def start(self, n, dt, force, nominal):
        return SlidingModeObserver().start(n, dt, force, nominal)


@pytest.mark.parametrize("measured", [False, True])
def test_an_observer_outside_of_the_loop_is_told_what_one_inside_is(measured):
    options = {**ROUGH, "actuator": {**ROUGH["actuator"], "measured": measured}}
    envs = [
        ObserverWrapper(gymnasium.make("SMOPendulum-v0", **options), observer)
        for observer in (SlidingModeObserver(), Outside())
    ]
    pair = [env.reset(seed=2)[0] for env in envs]
    for _ in range(30):
        assert equal(*pair)
        pair = [env.step(np.array([3.0]))[0] for env in envs]


def test_an_observer_is_told_the_force_that_was_asked_for_or_where_it_is_measured_that_which_came():
    def estimate(**actuator):
        env = ObserverWrapper(gymnasium.make("SMOPendulum-v0", actuator={"time_constant": 0.5, **actuator}), "smo")
        env.reset(seed=0, options={"state": [0.0, 0.0, 0.0, 0.0]})
        return env.step(np.array([20.0]))[0][4]

    assert abs(estimate(measured=True)) < 0.2 * abs(estimate())


def test_ended_slots_hold_still():
    env = gymnasium.make_vec("SMOPendulum-v0", 2, autoreset_mode="Disabled", **{**ROUGH, "horizon": 1.0})
    env.reset(seed=0, options={"steps": np.array([2, 50])})
    for _ in range(2):
        observation, *_ = env.step(np.ones((2, 1)))
    for _ in range(5):
        later, *_, info = env.step(np.ones((2, 1)))
        assert equal(later[0], observation[0])
        assert (info["samples"][0] == observation[0]).all()
        assert info["force"][0] == 0.0
        assert info["asked"][0] == 0.0


def test_copies_and_spawned_environments_are_alike():
    env = gymnasium.make("SMOPendulum-v0", **ROUGH)
    env.reset(seed=1)
    again = pickle.loads(pickle.dumps(env.unwrapped))
    assert equal(env.step(np.array([1.0]))[0], again.step(np.array([1.0]))[0])
    made = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert made.unwrapped.task == env.unwrapped.task


@pytest.mark.parametrize("kind", ["sensor", "actuator", "friction", "disturbance"])
def test_a_preset_is_known_by_its_name(kind):
    known = getattr(presets, f"{kind}s".upper())
    for name, preset in known.items():
        task = gymnasium.make("SMOPendulum-v0", **{kind: name}).unwrapped.task
        assert getattr(task, kind) == preset.settings
        assert preset.source
    wrong = f"{[*known][-1]}x"
    with pytest.raises(ValueError, match="did you mean") as error:
        gymnasium.make("SMOPendulum-v0", **{kind: wrong})
    assert str(error.value) == unknown(kind, wrong, known)


BAD = {
    "friction_uncertainty": (1.0, "friction_uncertainty=1.0 must be a fraction"),
    "sensor": ({"delay": (40_000, 0)}, "delay"),
    "actuator": ({"unit": 0.0}, "unit=0.0"),
    "friction": ({"cart_coulomb": -1.0}, "cart_coulomb=-1.0"),
    "disturbance": ({"kind": "stp"}, "'step'"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_not_allowed_is_named(name):
    value, words = BAD[name]
    with pytest.raises(ValueError, match=words):
        gymnasium.make("SMOPendulum-v0", **{name: value})


@pytest.mark.parametrize("noise", [-1, 2**52, 0.5, True, [1, 2, 3]])
def test_a_noise_is_a_whole_number(noise):
    env = gymnasium.make("SMOPendulum-v0", sensor="encoders")
    with pytest.raises(ValueError, match=r"options\['noise'\]=.* must be a whole number in \[0, 2\*\*52\)"):
        env.reset(options={"noise": noise})


def random_value(rng):
    """A number, sensible or not, or a pair of them."""
    numbers = [0, 1, -1, 3, 40, 0.0, 0.5, 1.5, -0.1, 1e-3, 0.002, math.nan, None, True, "x", 10**9]
    pick = [numbers[i] for i in rng.integers(len(numbers), size=2)]
    return pick[0] if rng.random() < 0.3 else tuple(pick)


def random_options(rng):
    """Some fields of each kind, of values that are likely to be refused now and then."""
    options = {}
    for kind, cls in {"sensor": Sensor, "actuator": Actuator, "friction": Friction, "disturbance": Disturbance}.items():
        names = [field.name for field in fields(cls)]
        chosen = rng.choice(names, rng.integers(3), replace=False).tolist()
        options[kind] = {name: getattr(cls(), name) if rng.random() < 0.5 else random_value(rng) for name in chosen}
    return options


def refused_or_worked(options):
    """Whether an environment works, where it is not refused by the name of one of the options' fields."""
    try:
        env = gymnasium.make("SMOPendulum-v0", disable_env_checker=True, **options)
    except ValueError as error:
        if not any(name in str(error) for given in options.values() for name in given):
            raise AssertionError(f"{options} is refused without a name") from error
        return False
    env.reset(seed=0)
    observation, reward, _, _, info = env.step(np.array([1.0]))
    assert np.isfinite(observation).all()
    assert np.isfinite(reward)
    assert np.isfinite(info["force"])
    return True


def test_any_options_are_refused_by_name_or_work():
    rng = np.random.default_rng(0)
    worked = [refused_or_worked(random_options(rng)) for _ in range(1000)]
    assert 100 < sum(worked) < 900


def _lost(t, h, theta, v, omega):
    return (math.nan if t > 0.03 and h > 0.5 else 0.0), 0.0


@pytest.mark.parametrize("mode", ["Disabled", "NextStep", "SameStep"])
def test_a_disturbance_that_is_not_finite_is_named_once_an_episode(make_vec, mode):
    options = {"state": np.array([[0.0] * 4, [1.0, 0, 0, 0]])}
    env = make_vec(2, disturbance=_lost, initial_state=(0.0, 0.0, 0.0, 0.0), autoreset_mode=mode)
    env.reset(seed=0, options=options)
    env.step(np.zeros((2, 1)))
    with pytest.warns(UserWarning, match=r"slot 1: its disturbance was not finite at t = 0\.031 s"):
        env.step(np.zeros((2, 1)))
    for _ in range(3):
        env.step(np.zeros((2, 1)))  # a warning would be an error


def test_one_episode_whose_disturbance_is_not_finite_says_so():
    env = gymnasium.make("SMOPendulum-v0", disturbance=_lost, disable_env_checker=True).unwrapped
    env.reset(seed=0, options={"state": [1.0, 0, 0, 0]})
    env.step(np.zeros(1))
    with pytest.warns(UserWarning, match=r"slot 0: its disturbance was not finite at t = 0\.031 s"):
        assert env.step(np.zeros(1))[2]
