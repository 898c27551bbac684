"""Settings of disturbances: what they are made of, and what is not allowed."""

import math
import re

import pytest

from smo_gym.disturbances import Disturbance
from smo_gym.kernels import COMPILES


def wind(t, h, theta, h_dot, theta_dot):
    """A push of one's own."""
    return -0.5 * h_dot, 0


def test_disturbances_are_made_of_what_a_file_holds():
    one = Disturbance("step", force=1.0, start=(0, 2))
    assert Disturbance.of(None) == Disturbance.of([]) == ()
    assert Disturbance.of({"kind": "step", "force": 1, "start": [0, 2]}) == Disturbance.of(one) == (one,)
    assert Disturbance.of([one, {"force": 2}, None]) == (one, Disturbance(force=2.0))


def one_argument(t):
    """Of a wrong signature."""
    return t, t


def one_number(t, h, theta, h_dot, theta_dot):
    """Of a wrong result."""
    return t


def unknown_name(t, h, theta, h_dot, theta_dot):
    """No name that Numba can find."""
    return nowhere(t), h  # noqa: F821


compiled_alone = pytest.mark.skipif(not COMPILES, reason="is said when it is compiled")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "stp"}, "unknown kind of disturbance 'stp': did you mean 'step'? known are"),
        ({"kind": 3}, "unknown kind of disturbance 3: "),
        ({"forse": 1.0}, "unknown disturbance setting 'forse': did you mean 'force'?"),
        ({"force": math.nan}, "disturbance force=nan must be a finite number"),
        ({"force": (2.0, 1.0)}, "disturbance force=(2.0, 1.0) must have low at most high"),
        ({"force": (1.0, 2.0, 3.0)}, "disturbance force=(1.0, 2.0, 3.0) must be a number or a pair (low, high)"),
        ({"torque": "1"}, "disturbance torque='1' must be a finite number"),
        ({"kind": "step", "start": (-1, 0)}, "disturbance start=(-1.0, 0.0) must be at least 0"),
        ({"kind": "sine", "frequency": (0.0, 1.0)}, "disturbance frequency=(0.0, 1.0) must be greater than 0"),
        ({"kind": "sine", "phase": (-7.0, 0.0)}, "disturbance phase=(-7.0, 0.0) must be within a turn"),
        ({"kind": "noise", "bandwidth": 0}, "disturbance bandwidth=0 must be a finite number greater than 0"),
        ({"kind": "pulses", "frequency": (1, 9), "width": 0.2}, "disturbance width=0.2 must be at most 1 / frequency"),
        ({"start": 1.0}, "disturbance start=1.0 is of no use to kind='constant': leave it out, or take kind 'step' or"),
        ({"kind": "sine", "width": 0.3}, "disturbance width=0.3 is of no use to kind='sine'"),
        ({"kind": "function"}, "disturbance function=None must be a function, plain or compiled by Numba"),
        ({"kind": "function", "function": wind, "force": 1.0}, "disturbance force=1.0 is of no use to kind='function'"),
        (one_argument, "must take (t, h, theta, h_dot, theta_dot) and give (force, torque): too many positional"),
        pytest.param(one_number, "and give (force, torque), two numbers; it gives float64", marks=compiled_alone),
        pytest.param(unknown_name, "cannot be compiled by Numba: NameError: name 'nowhere'", marks=compiled_alone),
        (print, "disturbance function=<built-in function print> must be a function, plain or compiled by Numba"),
        ([wind, wind], "must have at most one function: let it add them up"),
        ([{"force": 1.0}] * 9, "must be at most 8 at once, it is 9"),
        (3.0, "disturbance=3.0 must be a Disturbance, a mapping of its fields, a function or several"),
        ("gusts", "disturbance='gusts' must be a Disturbance"),
    ],
)
def test_what_is_not_allowed_is_named(given, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        Disturbance.of(given)


def test_a_disturbance_acts_within_the_episode_and_between_samples():
    Disturbance("step", force=1.0, start=(0.0, 0.9)).check(0.001, 1.0)
    with pytest.raises(ValueError, match=r"start=\(0\.0, 1\.0\) s must be less than the horizon=1\.0 s"):
        Disturbance("step", force=1.0, start=(0.0, 1.0)).check(0.001, 1.0)
    with pytest.raises(ValueError, match=r"width=0\.0005 s must be at least a sampling period dt=0\.001 s"):
        Disturbance("pulses", force=1.0, width=0.0005).check(0.001, 1.0)
    Disturbance("sine", force=1.0, frequency=(1.0, 500.0)).check(0.001, 1.0)
    with pytest.raises(ValueError, match=r"frequency=\(1\.0, 501\.0\) Hz must be at most 500 Hz, half the sampling"):
        Disturbance("sine", force=1.0, frequency=(1.0, 501.0)).check(0.001, 1.0)
