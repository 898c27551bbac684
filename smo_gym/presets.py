"""Sensors, actuators, friction and disturbances by name, and where their numbers come from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from .actuators import Actuator
from .disturbances import Disturbance
from .friction import Friction
from .sensors import Sensor
from .validation import choice

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Preset(Generic[T]):
    """Settings and their source."""

    settings: T
    source: str


_TURN = 2.0 * math.pi
_DEGREE = math.pi / 180.0
_CART_POLE = (
    "measured: 90 swing-ups of a cart on a belt with a pole on a potentiometer (SensorsINI/CartPoleSimulation, "
    "recordings V1)"
)
_SUITE = (
    "Real-World RL suite, combined challenge {!r} (Dulac-Arnold et al., Challenges of real-world reinforcement learning, "
    "Machine Learning 110, 2021): noise {} on each observation, delay of {} steps, dropped and stuck sensors with "
    "probability {} for {} steps, at the 10 ms a step of its cart pole. There a dropped value is 0, here the last one; "
    "there the noise is on cos and sin of the angle"
)


def _suite(name: str, noise: float, delay: int, probability: float, steps: int) -> Preset[Sensor]:
    """One of the suite's challenges, at a sampling period of 1 ms, of which it has ten a step."""
    sensor = Sensor(
        noise=(noise, noise),
        update_period=(0.01, 0.01),
        delay=(10 * delay, 10 * delay),
        dropout=(probability / 10.0, probability / 10.0),
        dropout_samples=(10 * steps, 10 * steps),
        stuck=(probability / 10.0, probability / 10.0),
        stuck_samples=(10 * steps, 10 * steps),
    )
    return Preset(sensor, _SUITE.format(name, noise, delay, probability, steps))


SENSORS = {
    "exact": Preset(Sensor(), "the article: positions without any error"),
    "encoders": Preset(
        Sensor(resolution=(1e-4, _TURN / 4096)), "chosen: 0.1 mm and 4096 counts a turn, as usual in teaching"
    ),
    "ip02": Preset(
        Sensor(resolution=(2.275e-5, _TURN / 4096)),
        "data sheet: Quanser IP02 user manual, encoder of the cart 2.275e-5 m a count, of the rod 4096 counts a turn",
    ),
    "as5600": Preset(
        Sensor(resolution=(1e-4, _TURN / 4096), noise=(0.0, 0.043 * _DEGREE)),
        "data sheet: ams AS5600 (v1-06), 12 bits a turn and 0.043 degrees of rms noise with the fastest filter; the "
        "cart's 0.1 mm is chosen",
    ),
    "cart-pole": Preset(
        Sensor(
            dead_zone=(0.0, 1.15),
            dead_width=(0.0, 0.25),
            noise=(0.0, 1.2e-3),
            speed_noise=(0.0, 7.3e-5),
            resolution=(8.498e-5, _TURN / 4096),
            update_period=(0.02, 0.02),
            dropout=(9e-5, 9e-5),
            dropout_samples=(20, 20),
        ),
        f"{_CART_POLE}: counts of 85 um and 2 pi / 4096 of reading; noise of 0.80 counts at rest to 1.25 beyond 9 rad/s; "
        "1 rad of reading is 0.96 rad; the reading sticks from 1.15 rad on for 0.25 rad; 0.18 % of samples missing; its "
        "period of 20.29 ms taken as 20 ms",
    ),
    "qube": Preset(
        Sensor(resolution=(1e-4, _TURN / 2048), update_period=(0.002, 0.002)),
        "measured: Quanser QUBE-Servo, 12 recordings at 500 Hz (decargroup/closed_loop_koopman): 2048 counts a turn and no "
        "noise beyond; it has no cart, whose 0.1 mm is chosen",
    ),
    "rwrl-easy": _suite("easy", 0.1, 3, 0.01, 1),
    "rwrl-medium": _suite("medium", 0.3, 6, 0.05, 5),
    "rwrl-hard": _suite("hard", 1.0, 9, 0.1, 10),
}
ACTUATORS = {
    "ideal": Preset(Actuator(), "the article: the force that is asked for reaches the cart"),
}
FRICTIONS = {
    "none": Preset(Friction(), "the article: no friction"),
}
DISTURBANCES: dict[str, Preset[tuple[Disturbance, ...]]] = {
    "none": Preset((), "the article: no disturbance"),
}


def sensor(value: Any) -> Sensor:
    """A sensor from one, a mapping of its fields, a preset's name or None for exact ones.

    Raises:
        ValueError: an unknown name or field, or a value that is not allowed.
    """
    return SENSORS[choice("sensor", value, SENSORS)].settings if isinstance(value, str) else Sensor.of(value)


def actuator(value: Any) -> Actuator:
    """An actuator from one, a mapping of its fields, a preset's name or None for the ideal one.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    return ACTUATORS[choice("actuator", value, ACTUATORS)].settings if isinstance(value, str) else Actuator.of(value)


def friction(value: Any) -> Friction | None:
    """Friction from itself, a mapping of its fields or a preset's name; None is left to the nominal plant.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    if isinstance(value, str):
        return FRICTIONS[choice("friction", value, FRICTIONS)].settings
    return None if value is None else Friction.of(value)


def disturbance(value: Any) -> tuple[Disturbance, ...]:
    """Disturbances that add up, from one, a mapping, a function, several of these, a preset's name or None.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    if isinstance(value, str):
        return DISTURBANCES[choice("disturbance", value, DISTURBANCES)].settings
    return Disturbance.of(value)
