"""What an episode of the pendulum is: options, draws, reward and end. Both environments are made of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from gymnasium import spaces

from .. import presets
from ..actuators import Actuator
from ..disturbances import Disturbance
from ..friction import Friction
from ..kernels.rk4 import STABLE
from ..plant import CartPendulum
from ..reference import Reference, shipped
from ..sensors import Sensor
from ..typing import Array
from ..validation import array, instance, limit, multiple, number, shape_of, short, unknown, whole

_FURTHEST = 10_000  # control instants of a preview: an observation holds four numbers of each
KEYS = 2**52
"""How many sequences of random numbers there are: each episode's noise, disturbances and friction follow from one."""


@dataclass(frozen=True, slots=True)
class Reward:
    """Weights of the quadratic reward (all chosen).

    ``r = -control_period (q . e^2 + r u^2) - failure [terminated]`` with e = x - x_d at the end of the control period
    (x_d = 0 without a reference): minus the cost an LQR with Q = diag(q) and R = r minimises, and a penalty for
    leaving the track or falling.

    Args:
        q: weights of h^2, theta^2, h'^2, theta'^2 in 1/s per unit squared, shape (4,).
        r: weight of u^2 in 1/(s N^2).
        failure: penalty for a terminated episode.

    Raises:
        ValueError: a weight is negative or not finite.
    """

    q: tuple[float, float, float, float] = (1.0, 1.0, 0.1, 0.1)
    r: float = 1e-3
    failure: float = 100.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", tuple(array("reward q", self.q, (4,)).tolist()))
        for name in ("r", "failure"):
            object.__setattr__(self, name, number(f"reward {name}", getattr(self, name)))
        if min(*self.q, self.r, self.failure) < 0.0:
            raise ValueError(f"{self} must have weights of at least 0")

    @classmethod
    def of(cls, reward: Reward | Mapping[str, Any] | None) -> Reward:
        """Weights from weights, a mapping of field names or None (the defaults)."""
        return instance(cls, "reward weight", reward)


@dataclass(frozen=True, slots=True)
class Task:
    """Options of the environments; :class:`~smo_gym.envs.pendulum.PendulumEnv` says what each means."""

    control_period: float = 0.02
    dt: float = 0.001
    params: CartPendulum = field(default_factory=CartPendulum)
    uncertainty: float = 0.1
    initial_state: Any = ((-1.0, -1.0, 0.1, 0.01), (1.0, 1.0, 0.1, 0.01))
    force_limit: float = 30.0
    track_limit: float = 5.0
    angle_limit: float = math.inf
    horizon: float = 35.0
    reward: Reward = field(default_factory=Reward)
    reference: Reference | None = None
    preview: int = 5
    sensor: Sensor = field(default_factory=Sensor)
    actuator: Actuator = field(default_factory=Actuator)
    disturbance: tuple[Disturbance, ...] = ()
    friction: Friction | None = None
    friction_uncertainty: float = 0.0

    @classmethod
    def of(cls, options: Mapping[str, Any], base: Task) -> Task:
        """A task from keyword options; what they leave out, parts of ``params`` too, is taken from ``base``.

        Raises:
            ValueError: an unknown option, or a value that is not allowed.
        """
        known = [f.name for f in fields(cls)]
        for name in options:
            if name not in known:
                raise ValueError(unknown("environment option", name, [*known, "render_mode"]))
        changes = {**options, "params": CartPendulum.of(options.get("params"), base.params)}
        if options.get("reference") is not None:  # it says where an episode begins and how long it is
            changes["reference"] = reference = Reference.of(options["reference"])
            changes = {"initial_state": reference.x0, "horizon": reference.horizon, **changes}
        task = replace(base, **changes)
        between: tuple[Sensor | Actuator | Disturbance, ...] = (task.sensor, task.actuator, *task.disturbance)
        for each in between:
            each.check(task.dt, task.horizon)
        return task

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        for name in ("dt", "control_period", "horizon"):
            set_(self, name, number(name, getattr(self, name), above=0.0))
        multiple("control_period", self.control_period, "the integration step dt", self.dt)
        multiple("horizon", self.horizon, "control_period", self.control_period)
        set_(self, "params", CartPendulum.of(self.params))
        set_(self, "reward", Reward.of(self.reward))
        for name in ("uncertainty", "friction_uncertainty"):
            set_(self, name, number(name, getattr(self, name)))
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name}={getattr(self, name)!r} must be a fraction in [0, 1)")
        set_(self, "sensor", presets.sensor(self.sensor, self.dt))
        set_(self, "actuator", presets.actuator(self.actuator, self.dt))
        set_(self, "disturbance", presets.disturbance(self.disturbance, self.dt))
        set_(self, "friction", presets.friction(self.friction, self.dt))
        self._check_plant()
        if self.reference is not None and self.reference.params != tuple(self.params.as_array().tolist()):
            raise ValueError(
                f"reference was computed for the plant {self.reference.params}, it must be for params={self.params}"
            )
        set_(self, "preview", whole("preview", self.preview, 0))
        if self.preview > _FURTHEST:
            raise ValueError(f"preview={self.preview} must be at most {_FURTHEST} control instants")
        for name in ("force_limit", "track_limit", "angle_limit"):
            set_(self, name, limit(name, getattr(self, name)))
        low, high = self._box()
        set_(self, "initial_state", (tuple(low.tolist()), tuple(high.tolist())))

    def _check_plant(self) -> None:
        """See that Runge-Kutta steps are stable for friction and back-EMF, which brake light plants the fastest."""
        c, _, b = (1.0 + self.friction_uncertainty) * self.rubs.as_array()
        brakes = Friction(c + self.actuator.back_emf, 0.0, b)
        light = replace(self.params.perturbed([-self.uncertainty] * 3), friction=brakes)
        with np.errstate(all="ignore"):
            rates = light.linearise()[0][2:, 2:]
        fastest = np.abs(np.linalg.eigvals(rates)).max() if np.isfinite(rates).all() else math.inf
        if brakes and self.dt * fastest >= STABLE:
            rubs, emf = self.rubs, self.actuator.back_emf
            values = {"cart_viscous": rubs.cart_viscous, "pivot_viscous": rubs.pivot_viscous, "back_emf": emf}
            named = ", ".join(f"{name}={value!r}" for name, value in values.items() if value)
            raise ValueError(
                f"{named} brake the lightest plant so fast that steps of dt={self.dt!r} s are unstable: dt must be "
                f"less than {STABLE / fastest:.4g} s, or they smaller"
            )

    def _box(self) -> tuple[Array, Array]:
        shape = shape_of(self.initial_state)
        if shape == (4,):
            low = high = array("initial_state", self.initial_state, (4,))
        elif shape == (2, 4):
            low, high = array("initial_state", self.initial_state, (2, 4))
        else:
            raise ValueError(
                f"initial_state has shape {shape}, it must be one state (4,) or a box of states [low, high], (2, 4)"
            )
        if (low > high).any():
            raise ValueError(f"initial_state has low={low.tolist()} above high={high.tolist()}")
        return low, high

    @property
    def substeps(self) -> int:
        """Integration steps, and samples of the sensors, in one control period."""
        return multiple("control_period", self.control_period, "dt", self.dt)

    @property
    def steps(self) -> int:
        """Control periods in an episode."""
        return multiple("horizon", self.horizon, "control_period", self.control_period)

    @property
    def observation_space(self) -> spaces.Space[Array]:
        """[h, theta], which encoders count without end, and x_d now and ahead where there is a reference."""
        told = 0 if self.reference is None else 4 * (1 + self.preview)
        return spaces.Box(-np.inf, np.inf, (2 + told,), np.float64)

    @property
    def action_space(self) -> spaces.Space[Array]:
        """The force in N, or the command in the actuator's unit."""
        most = self.force_limit / self.actuator.unit
        return spaces.Box(-most, most, (1,), np.float64)

    @property
    def rubs(self) -> Friction:
        """The true plants' friction, before its uncertainty."""
        return self.params.friction if self.friction is None else self.friction

    @property
    def ideal(self) -> bool:
        """Whether the force that is asked for, and no other, moves a plant without friction."""
        return self.actuator.ideal and not self.disturbance and not self.rubs

    @property
    def exact(self) -> bool:
        """Whether nothing stands between plant and computer, as in the article."""
        return self.ideal and self.sensor.exact

    @property
    def random(self) -> bool:
        """Whether anything in an episode is random beside its plant and initial state."""
        rubs = self.friction_uncertainty > 0.0 and bool(self.rubs)
        return rubs or self.sensor.random or any(each.random for each in self.disturbance)

    def draw(self, rng: np.random.Generator) -> Case:
        """An episode from an environment's own generator."""
        params = self.params.draw(self.uncertainty, rng).as_array()
        low, high = self.initial_state
        state = rng.uniform(low, high)
        return Case(params, state, _key(rng) if self.random else 0.0)

    def asked(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """The fields of a :class:`Case` that reset options ask for.

        Raises:
            ValueError: an option has a value that is not allowed.
        """
        found: dict[str, Any] = {}
        if options.get("params") is not None:
            found["params"] = CartPendulum.of(options["params"], self.params).as_array()
        if options.get("state") is not None:
            found["state"] = array("options['state']", options["state"], (4,))
        if options.get("noise") is not None:
            noise = options["noise"]
            if not isinstance(noise, int | np.integer) or isinstance(noise, bool) or not 0 <= noise < KEYS:
                raise ValueError(
                    f"options['noise']={short(noise)} must be a whole number in [0, 2**52), in a batch also one a slot"
                )
            found["key"] = float(noise)
        return found

    def as_options(self) -> dict[str, Any]:
        """The options that make this task, as plain data: what :meth:`of` takes and JSON holds."""
        return plain_data({f.name: getattr(self, f.name) for f in fields(self)})  # type: ignore[no-any-return]


def _key(rng: np.random.Generator) -> float:
    """A key from far ahead in a generator's sequence: plants and states to come are those of exact runs."""
    ahead = rng.bit_generator.jumped()  # type: ignore[attr-defined]
    return float(np.random.Generator(ahead).integers(KEYS))


@dataclass(frozen=True, slots=True)
class Case:
    """What one episode draws.

    Args:
        params: the plant [M_c, m, l, g], (4,).
        state: where it begins, (4,).
        key: from which all noise, disturbances and friction of the episode follow, a whole number below :data:`KEYS`.
    """

    params: Array
    state: Array
    key: float


HANGING = Task()
"""Defaults of SMOPendulum-v0: the article's plant; the initial states are the box that Table 5's four cases span."""

UPRIGHT = Task(
    params=CartPendulum(gravity=9.8),
    initial_state=((0.0, -0.2, 0.0, 0.0), (0.0, 0.2, 0.0, 0.0)),
    angle_limit=math.pi / 2,
)
"""Defaults of SMOPendulumUpright-v0."""

TRACKING = Task.of({"reference": shipped()}, HANGING)
"""Defaults of SMOPendulumTracking-v0: the article's plant and the reference of its Table 7."""


def plain_data(value: Any) -> Any:
    """A value as numbers, text, lists and mappings: dataclasses by field, arrays as lists, enumerations by value."""
    if isinstance(value, CartPendulum):
        return value.as_dict()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain_data(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {name: plain_data(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(inner) for inner in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value.value if isinstance(value, Enum) else value
