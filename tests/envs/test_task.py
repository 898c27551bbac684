"""What an episode is: options that depend on one another, and what is drawn."""

import gymnasium
import numpy as np
import pytest

from smo_gym import CartPendulum
from smo_gym.friction import rubbing
from smo_gym.loop import Loop

NOISY = {"sensor": {"noise": (1e-3, 1e-3)}, "disturbance": {"kind": "noise", "force": 1.0}}


@pytest.mark.parametrize("kind", ["sensor", "actuator"])
def test_a_preset_that_counts_samples_is_refused_at_another_period(kind):
    words = rf"{kind}='rwrl-easy' counts samples of dt=0\.001 s, .* not dt=0\.002: for another give fields"
    with pytest.raises(ValueError, match=words):
        gymnasium.make("SMOPendulum-v0", dt=0.002, **{kind: "rwrl-easy"})
    gymnasium.make("SMOPendulum-v0", dt=0.002, **{kind: {"sensor": "as5600", "actuator": "lag"}[kind]})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"friction": {"pivot_viscous": 500.0}}, r"^pivot_viscous=500\.0 brake .* dt=0\.001 s are .* less than \S+ s"),
        (
            {"friction": {"cart_viscous": 5e3}, "actuator": {"back_emf": 7e3}},
            r"^cart_viscous=5000\.0, back_emf=7000",
        ),
        ({"params": {"friction": {"cart_viscous": 2e4}}}, r"^cart_viscous=20000\.0 brake"),
    ],
)
def test_friction_too_fast_for_a_step_is_named(options, words):
    with pytest.raises(ValueError, match=words):
        gymnasium.make("SMOPendulum-v0", **options)


def test_the_largest_step_is_that_of_the_lightest_plant_with_the_most_friction():
    rubs, options = {"cart_viscous": 20.0, "pivot_viscous": 30.0}, {"uncertainty": 0.3, "friction_uncertainty": 0.2}
    with pytest.raises(ValueError, match="unstable") as error:
        gymnasium.make("SMOPendulum-v0", dt=0.02, friction=rubs, actuator={"back_emf": 9.0}, **options)
    most = float(str(error.value).split("less than ")[1].split()[0])
    params = CartPendulum().perturbed([-0.3] * 3).as_array()[:, None]
    params[3] = 0.0

    def speed(dt):
        """After 200 steps, of 1 at the start, without gravity."""
        loop = Loop(1, 200, {"plant": rubbing(params, dt, 1.2 * np.array([[20.0], [0.0], [30.0]]), 9.0)})
        loop.start(slice(None), np.array([[0.0], [0.0], [1e-9], [1e-9]]))
        loop.run()
        return np.abs(loop.x[2:]).max() / 1e-9

    assert speed(0.99 * most) < 0.5
    assert speed(1.01 * most) > 2.0


def test_a_cut_episode_may_end_before_its_push_begins():
    one, many = (
        make("SMOPendulum-v0", max_episode_steps=50, disturbance="push")
        for make in (gymnasium.make, gymnasium.make_vec)
    )
    for env, force in ((one, np.zeros(1)), (many, np.zeros((1, 1)))):
        env.reset(seed=0)
        truncated = [bool(np.all(env.step(force)[3])) for _ in range(50)]
        assert truncated == [False] * 49 + [True]
    with pytest.raises(ValueError, match=r"start=\(1\.0, 5\.0\) s must be less than the horizon=1\.0 s"):
        gymnasium.make("SMOPendulum-v0", horizon=1.0, disturbance="push")


def test_noise_is_drawn_aside_of_plants_and_states():
    quiet, noisy, again = (gymnasium.make("SMOPendulum-v0", **options) for options in ({}, NOISY, NOISY))
    first = [env.reset(seed=5) for env in (quiet, noisy, again)]
    episodes = [first, *([env.reset() for env in (quiet, noisy, again)] for _ in range(4))]
    errors = []
    for (_, told), (y, other), (y_again, _) in episodes:
        assert np.array_equal(told["params"], other["params"])
        assert np.array_equal(told["state"], other["state"])
        assert np.array_equal(y, y_again)
        errors.append(y - other["state"][:2])
    assert len({tuple(error) for error in errors}) == 5
