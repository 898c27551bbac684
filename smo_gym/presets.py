"""Sensors, actuators, friction and disturbances by name, and where their numbers come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Generic, TypeVar

from .actuators import Actuator
from .disturbances import Disturbance
from .friction import Friction
from .kernels import plain
from .sensors import Sensor
from .validation import choice

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Preset(Generic[T]):
    """Settings and their source; ``dt`` is the sampling period in s that they count samples of, where they do."""

    settings: T
    source: str
    dt: float | None = None


_TURN = 2.0 * math.pi
_DEGREE = math.pi / 180.0
_CART_POLE = (
    "measured: 60 swing-ups of a cart on a belt with a pole on a potentiometer (SensorsINI/CartPoleSimulation, "
    "recordings V1)"
)
_SUITE = (
    "of the Real-World RL suite's combined challenge {!r} the sensors (Dulac-Arnold et al., Challenges of real-world "
    "reinforcement learning, Machine Learning 110, 2021), without its action noise and repetition, perturbed physics "
    "and delayed rewards: noise of {} on each observation, a delay of {} steps, dropped and stuck sensors with "
    "probability {} for {} steps, at the 10 ms a step of its cart pole. There a dropped value is 0, here the last one; "
    "there the noise is on cos and sin of the angle; here it goes on while a sensor is stuck"
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
    return Preset(sensor, _SUITE.format(name, noise, delay, probability, steps), 0.001)


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
        "data sheet: ams AS5600 (v1-06), 12 bits a turn and 0.043 degrees of rms noise with the fastest filter, "
        "here at every sample; the cart's 0.1 mm is chosen",
    ),
    "cart-pole": Preset(
        Sensor(
            scale=(1.0, 1.0 / 0.96),
            dead_zone=(0.0, 1.15),
            dead_width=(0.0, _TURN * (1.0 / 0.96 - 1.0)),
            noise=(0.0, 1.2e-3),
            speed_noise=(0.0, 7.3e-5),
            resolution=(8.498e-5, _TURN / 4096),
            update_period=(0.02, 0.02),
            dropout=(9e-5, 9e-5),
            dropout_samples=(20, 20),
        ),
        f"{_CART_POLE}: counts of 85 um and 2 pi / 4096 of reading; noise of 0.80 counts at rest to 1.25 beyond "
        "9 rad/s; 0.96 rad for 1 rad of reading; the reading sticks from 1.15 rad on for 0.25 rad of the rod, once a "
        "turn; 0.18 % of samples missing; the period of 20.29 ms taken as 20 ms",
        0.001,
    ),
    "qube": Preset(
        Sensor(resolution=(1e-4, _TURN / 2048), update_period=(0.002, 0.002)),
        "measured: Quanser QUBE-Servo, 12 recordings at 500 Hz (decargroup/closed_loop_koopman): 2048 counts a turn "
        "and no noise beyond; it has no cart, whose 0.1 mm is chosen",
    ),
    "rwrl-easy": _suite("easy", 0.1, 3, 0.01, 1),
    "rwrl-medium": _suite("medium", 0.3, 6, 0.05, 5),
    "rwrl-hard": _suite("hard", 1.0, 9, 0.1, 10),
}
ACTUATORS = {
    "ideal": Preset(Actuator(), "the article: the force that is asked for reaches the cart"),
    "cart-pole": Preset(
        Actuator(unit=26.49, back_emf=44.88),
        f"{_CART_POLE}: 9.56 m/s^2 at full command and 16.2 1/s of back-EMF, all viscous friction of the cart in it, "
        "on 2.77 kg that move; full command is 1, so force_limit=26.49; no delay (0 to 0.4 ms). Newtons follow from "
        "the 0.087 kg of its pole",
    ),
    "lag": Preset(Actuator(time_constant=0.005), "chosen: a current loop of some 30 Hz"),
    **{
        f"rwrl-{name}": Preset(
            Actuator(delay=10 * steps),
            f"Real-World RL suite, combined challenge {name!r}: a delay of {steps} steps of 10 ms",
            0.001,
        )
        for name, steps in (("easy", 3), ("medium", 6), ("hard", 9))
    },
}
FRICTIONS = {
    "none": Preset(Friction(), "the article: no friction"),
    "cart-pole": Preset(
        Friction(cart_coulomb=0.504, pivot_viscous=3.53e-4),
        f"{_CART_POLE}: 0.182 m/s^2 of Coulomb friction on 2.77 kg, 0.078 1/s about the pivot; viscous friction of the "
        "cart cannot be told from back-EMF and is in the actuator",
    ),
    "ip02": Preset(
        Friction(cart_viscous=5.4, pivot_viscous=0.0024),
        "data sheet: viscous damping of the Quanser IP02 with its extra weight, and of its long pendulum",
    ),
}
DISTURBANCES: dict[str, Preset[tuple[Disturbance, ...]]] = {
    "none": Preset((), "the article: no disturbance"),
    "cart-pole": Preset(
        (Disturbance("noise", force=1.54, bandwidth=15.0),),
        f"{_CART_POLE}: process noise of 0.081 m/s^2 per root Hz (two-sided) on 2.77 kg, 0.22 N per root Hz, as noise "
        "below 15 Hz, a cut-off that is chosen",
    ),
    "push": Preset(
        (Disturbance("step", force=(-1.0, 1.0), start=(1.0, 5.0)),),
        "chosen: a steady push of up to 1 N that begins within the first seconds",
    ),
}


KINDS: dict[str, Mapping[str, Preset[Any]]] = {
    "sensor": SENSORS,
    "actuator": ACTUATORS,
    "friction": FRICTIONS,
    "disturbance": DISTURBANCES,
}
"""All presets by the option that takes them."""


def sensor(value: Any, dt: float) -> Sensor:
    """A sensor from one, a mapping of its fields, a preset's name or None for exact ones.

    Raises:
        ValueError: an unknown name or field, a value that is not allowed, or a preset that counts samples of another
            period than ``dt``.
    """
    return _named("sensor", SENSORS, value, dt) if isinstance(value, str) else Sensor.of(value)


def actuator(value: Any, dt: float) -> Actuator:
    """An actuator from one, a mapping of its fields, a preset's name or None for the ideal one.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    return _named("actuator", ACTUATORS, value, dt) if isinstance(value, str) else Actuator.of(value)


def friction(value: Any, dt: float) -> Friction | None:
    """Friction from itself, a mapping of its fields or a preset's name; None is left to the nominal plant.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    if isinstance(value, str):
        return _named("friction", FRICTIONS, value, dt)
    return None if value is None else Friction.of(value)


def disturbance(value: Any, dt: float) -> tuple[Disturbance, ...]:
    """Disturbances that add up, from one, a mapping, a function, several of these, a preset's name or None.

    Raises:
        ValueError: as of :func:`sensor`.
    """
    return _named("disturbance", DISTURBANCES, value, dt) if isinstance(value, str) else Disturbance.of(value)


def _named(kind: str, known: Mapping[str, Preset[T]], name: str, dt: float) -> T:
    preset = known[choice(kind, name, known)]
    if preset.dt is not None and not math.isclose(preset.dt, dt):
        raise ValueError(
            f"{kind}={name!r} counts samples of dt={preset.dt!r} s, which it must have, not dt={dt!r}: for another "
            "give fields in place of the name"
        )
    return preset.settings


def said(settings: Any, whole: bool = False) -> str:
    """Settings by field: all, or those that are not the default; of a disturbance always its kind."""
    if isinstance(settings, tuple):
        return "; ".join(said(each, whole) for each in settings)
    usual = type(settings)()
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    return ", ".join(
        f"{name}={_short(value)}"
        for name, value in values.items()
        if whole or name == "kind" or value != getattr(usual, name)
    )


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_short, value))})"
    if callable(value):
        return spelled(value)
    return f"{value:.5g}" if isinstance(value, float) else repr(value)


def spelled(function: Any) -> str:
    """A function as module:function."""
    inner = plain(function)
    return f"{inner.__module__}:{inner.__qualname__}"
