"""Checks of arguments: any type and size is answered by a short sentence that names it."""

import enum

import gymnasium
import numpy as np
import pytest

import smo_gym
from smo_gym import validation


@pytest.mark.parametrize(
    ("check", "message"),
    [
        (lambda: validation.number("m", 10**400), r"m=1000.* must be a finite number"),
        (lambda: validation.number("m", 10**5000), "m=a int must be a finite number"),
        (lambda: validation.number("m", True), "m=True must be"),
        (lambda: validation.array("x", [10**400] * 4, (4,)), r"x=\[1000.* must be an array of numbers"),
        (lambda: validation.array("x", {"a": 1}, (1,)), "x=.* must be an array"),
        (lambda: validation.limit("f", np.ones(4)), r"f=array\(.*\) must be a finite number greater than 0"),
        (lambda: validation.multiple("p", 0.02, "dt", 5e-324), "p=0.02 must be at most 1e\\+08 times dt"),
        (lambda: validation.multiple("p", 0.02, "dt", 0.0), "dt=0.0 must be a finite number greater than 0"),
        (lambda: validation.whole("n", 1.5, 1), "n=1.5 must be a positive integer"),
        (lambda: validation.whole("n", True, 1), "n=True must be a positive integer"),
        (lambda: validation.whole("n", np.int64(-1), 0), "must be a whole number of at least 0"),
        (lambda: validation.choice("arm", ["with"], ["with"]), "unknown arm"),
        (lambda: validation.mapping("option", 5, ["a"]), "option: 5 must be a mapping"),
        (lambda: smo_gym.reference.shipped().trajectory(0.0), "dt=0.0 must be"),
        (lambda: smo_gym.LQR([1, 1, 1, 1], wrap="x"), "wrap='x' must be True or False"),
        (lambda: smo_gym.CartPendulum().drift("abcd"), "x='abcd' must be an array of numbers"),
        (lambda: smo_gym.CartPendulum().energy([1.0]), r"x has shape \(1,\), it must have shape"),
        (lambda: smo_gym.SlidingModeObserver(slopes=(10**400, 1)), r"slopes=\(1000.* must be two positive numbers"),
        (lambda: gymnasium.make("SMOPendulumTracking-v0", preview=10**9), "preview=1000000000 must be at most 10000"),
        (lambda: smo_gym.set_threads("2"), "threads='2' must be a positive integer"),
    ],
)
def test_what_is_wrong_is_named_in_a_short_sentence(check, message):
    with pytest.raises(ValueError, match=message) as caught:
        check()
    assert len(str(caught.value)) < 400


def test_numpys_whole_numbers_are_whole_numbers():
    found = validation.whole("n", np.int32(3), 1)
    assert type(found) is int
    assert found == 3


def test_plain_data_is_what_json_holds():
    class Mode(enum.Enum):
        FAST = "fast"

    given = {"a": np.arange(2), "b": (np.float64(1.5), Mode.FAST), "c": smo_gym.CartPendulum(), "d": None}
    assert smo_gym.envs.task.plain_data(given) == {
        "a": [0, 1],
        "b": [1.5, "fast"],
        "c": {"cart_mass": 3.5, "bob_mass": 0.32, "rod_length": 0.44, "gravity": -9.8},
        "d": None,
    }
