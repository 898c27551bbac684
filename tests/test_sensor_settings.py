"""A sensor's settings: what they are made of, and those that are refused by name."""

import math
import re

import numpy as np
import pytest

from smo_gym.loop import side_by_side
from smo_gym.sensors import Sensor, exact

DT = 0.001


def test_without_settings_a_sensor_is_exact():
    assert Sensor().exact
    assert not Sensor().random
    assert Sensor().part(3, DT).kind == exact(3).kind
    assert Sensor(dead_zone=(0.1, 0.2), stuck_samples=(3, 3), resolution=(None, None)).exact
    assert not Sensor(resolution=(None, 0.1)).exact


def test_sensors_of_different_settings_are_called_apart():
    parts = [Sensor(bias=(bias, 0.0)).part(2, DT) for bias in (0.1, 0.1, 0.2)]
    assert [part.rows.shape[1] for part in side_by_side(parts)] == [4, 2]
    assert len(side_by_side([Sensor(delay=(2, 0)).part(1, DT), Sensor(delay=(0, 2)).part(1, DT)])) == 2
    assert len(side_by_side([Sensor(jitter=1e-4).part(1, dt) for dt in (DT, 2 * DT)])) == 2


def test_a_sensor_is_made_of_a_mapping():
    sensor = Sensor.of({"noise": [1e-3, 2e-3], "delay": np.array([2, 3]), "resolution": [None, 0.01]})
    assert sensor == Sensor(noise=(1e-3, 2e-3), delay=(2, 3), resolution=(None, 0.01))
    assert Sensor.of(sensor) is sensor
    assert Sensor.of(None) == Sensor()
    assert hash(sensor) == hash(Sensor.of(sensor))


BAD = [
    ({"noises": (1, 1)}, "unknown sensor setting 'noises': did you mean 'noise'? known are 'bias', "),
    ({"noise": 0.1}, r"sensor noise=0.1 must be a pair (h, theta)"),
    ({"noise": (0.1, 0.1, 0.1)}, r"sensor noise=(0.1, 0.1, 0.1) must be a pair (h, theta)"),
    ({"bias": "ab"}, r"sensor bias='ab' must be a pair (h, theta)"),
    ({"noise": (0.1, -0.1)}, "sensor noise of theta=-0.1 must be at least 0"),
    ({"noise": (math.nan, 0.1)}, "sensor noise of h=nan must be a finite number"),
    ({"speed_noise": (-1, 0)}, "sensor speed_noise of h=-1 must be at least 0"),
    ({"scale": ("a", 1)}, "sensor scale of h='a' must be a finite number"),
    ({"bias": (0, math.inf)}, "sensor bias of theta=inf must be a finite number"),
    ({"dead_width": (0, -1)}, "sensor dead_width of theta=-1 must be at least 0"),
    ({"dead_width": (9, 6.5)}, "sensor dead_width of theta=6.5 must be less than a turn, 2 pi"),
    ({"resolution": (0, 0.1)}, "sensor resolution of h=0 must be at least 1e-12, or None for no quantisation"),
    ({"resolution": 0}, "sensor resolution=0 must be a pair (h, theta)"),
    ({"update_period": (-0.1, 0)}, "sensor update_period of h=-0.1 must be at least 0"),
    ({"stuck": (1.1, 0)}, "sensor stuck of h=1.1 must be a probability in [0, 1]"),
    ({"stuck_samples": (0, 1)}, "sensor stuck_samples of h=0 must be a positive integer"),
    ({"dropout": (0, -0.1)}, "sensor dropout of theta=-0.1 must be a probability in [0, 1]"),
    ({"dropout_samples": (1, 1.5)}, "sensor dropout_samples of theta=1.5 must be a positive integer"),
    ({"delay": (0.5, 1)}, "sensor delay of h=0.5 must be a whole number of at least 0"),
    ({"delay": (-1, 1)}, "sensor delay of h=-1 must be a whole number of at least 0"),
    ({"delay": (2, 2), "delay_least": (0, 3)}, "sensor delay_least of theta=3 must be at most its delay=2"),
    ({"delay": (2, 2), "hold": (0.5, 0)}, "sensor hold=(0.5, 0.0) must be 0 where the delay is fixed: set delay_least"),
    ({"jitter": -1e-3}, "sensor jitter=-0.001 must be at least 0"),
    ({"jitter": (1e-3, 0)}, "sensor jitter=(0.001, 0) must be a finite number"),
]


@pytest.mark.parametrize(("settings", "message"), BAD)
def test_a_setting_that_is_not_allowed_is_named(settings, message):
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        Sensor.of(settings)


def test_what_does_not_fit_the_sampling_or_the_episode_is_named():
    with pytest.raises(
        ValueError, match="update_period of theta=0.0015 must be a whole multiple of the sampling period"
    ):
        Sensor(update_period=(0.002, 0.0015)).check(0.001, 1.0)
    with pytest.raises(
        ValueError, match="update_period of h=0.0005 must be a whole multiple of the sampling period dt"
    ):
        Sensor(update_period=(0.0005, 0.0)).part(1, 0.001)
    with pytest.raises(
        ValueError, match="delay of theta=1000 samples of dt=0.001 s must be less than the horizon=1.0 s"
    ):
        Sensor(delay=(999, 1000)).check(0.001, 1.0)
    Sensor(delay=(999, 999), update_period=(0.0, 0.001)).check(0.001, 1.0)
