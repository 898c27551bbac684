"""Theorem 1 as numbers: its gain conditions, the times it promises, and gains that satisfy it.

The suprema of (28), (30) and (31) run over an operating set that must hold the trajectories of x *and* of xhat, and
over all plants of an uncertainty level.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .controllers import SlidingModeController
from .friction import Friction
from .kernels import plain
from .kernels.cart_pendulum import answer
from .observers import Gains, SlidingModeObserver
from .observers.sliding_mode import Slopes
from .plant import CartPendulum
from .typing import Array, Flags
from .validation import array, number


@dataclass(frozen=True, slots=True)
class OperatingSet:
    """All states, estimates and plants that a run may meet.

    Args:
        theta: bound of |theta| and |thetahat| in rad.
        speed: bounds of (|h'|, |theta'|) in m/s and rad/s.
        speed_hat: bounds of the estimates of these; they overshoot while the positions are still being reached.
        uncertainty: level x of the plants.
        model: nominal plant.
        push: bound of a matched disturbance in N.
        torque: bound of a disturbing torque about the pivot in N m.
        friction: of the plants, of which an observer knows nothing.

    Raises:
        ValueError: a bound is not positive or the level not in [0, 1): the set would hold no point; or the bound of a
            disturbance is negative.
    """

    theta: float
    speed: tuple[float, float]
    speed_hat: tuple[float, float]
    uncertainty: float
    model: CartPendulum = field(default_factory=CartPendulum)
    push: float = 0.0
    torque: float = 0.0
    friction: Friction = field(default_factory=Friction)

    def __post_init__(self) -> None:
        number("theta", self.theta, above=0.0)
        for name in ("speed", "speed_hat"):
            if (array(name, getattr(self, name), (2,)) <= 0.0).any():
                raise ValueError(f"{name}={getattr(self, name)!r} must be positive: the operating set holds no point")
        if not 0.0 <= number("uncertainty", self.uncertainty) < 1.0:
            raise ValueError(f"uncertainty={self.uncertainty!r} must be a fraction in [0, 1)")

        for name in ("push", "torque"):
            if number(name, getattr(self, name)) < 0.0:
                raise ValueError(f"{name}={getattr(self, name)!r} must be at least 0")

    def holds(self, x: Array, xhat: Array) -> Flags:
        """Which pairs of states (4, ...) and estimates (4, ...) are inside, (...)."""
        speed, speed_hat = (np.reshape(bound, (2, *[1] * (x.ndim - 1))) for bound in (self.speed, self.speed_hat))
        angles = (np.abs(x[1]) <= self.theta) & (np.abs(xhat[1]) <= self.theta)
        return np.asarray(angles & (np.abs(x[2:]) <= speed).all(axis=0) & (np.abs(xhat[2:]) <= speed_hat).all(axis=0))


@dataclass(frozen=True, slots=True)
class Suprema:
    """Right-hand sides of the conditions, one entry a row (h, theta)."""

    speed: Array
    """sup |X2| of (28) in m/s and rad/s, (2,)."""
    drift: Array
    """sup |f20(x) - f20(xhat) + f2Delta(x) + d2| of (30) in m/s^2 and rad/s^2, (2,); d2 is of disturbances."""
    gain: Array
    """sup |g20(x) - g20(xhat) + g2Delta(x)| of (31) in 1/kg and 1/(kg m), (2,)."""


def suprema(over: OperatingSet) -> Suprema:
    """The suprema over an operating set, where x, xhat and the plant vary independently.

    f2 and g2 are affine in theta'^2 and, one at a time, monotone in M_c, m and l (each is a Moebius function of them),
    so extremes lie at the corners of those; theta is scanned.

    The article's model has no disturbance. With a force d and a torque tau, and friction of which the observer knows
    nothing, X2' has d2 = M^-1 [d - c h' - F_c sgn h', tau - b theta'] more, M the mass matrix. Its supremum, with each
    term at its bound and of the worse sign, adds to that of (30): then Theorem 1 is as before.
    """
    f, g = _corners(over.theta, over.speed[1], _plants(over))
    fhat, ghat = _corners(over.theta, over.speed_hat[1], [over.model])
    return Suprema(
        speed=np.array(over.speed),
        drift=np.maximum(f.max(axis=1) - fhat.min(axis=1), fhat.max(axis=1) - f.min(axis=1)) + disturbed(over),
        gain=np.maximum(g.max(axis=1) - ghat.min(axis=1), ghat.max(axis=1) - g.min(axis=1)),
    )


def disturbed(over: OperatingSet) -> Array:
    """The supremum of |d2|, what disturbances and friction add to X2', one entry a row (see :func:`suprema`)."""
    c, coulomb, b = over.friction.as_array()
    force, torque = over.push + coulomb + c * over.speed[0], over.torque + b * over.speed[1]
    theta = np.linspace(-over.theta, over.theta, 4001)
    x = np.array([np.zeros_like(theta), theta, np.zeros_like(theta), np.zeros_like(theta)])
    largest = np.zeros(2)
    for plant in _plants(over):
        M_c, m, l, _ = plant.as_array()
        g_h, g_theta = plant.gain(x)[2:]
        from_force = np.abs(plain(answer)(g_h, g_theta, force, 0.0, M_c, m, l))
        from_torque = np.abs(plain(answer)(g_h, g_theta, 0.0, torque, M_c, m, l))
        largest = np.maximum(largest, (from_force + from_torque).max(axis=1))
    return largest


def acceleration(over: OperatingSet, force: float) -> Array:
    """The supremum of |X2'| = |f2(x) + g2(x) u| over an operating set while |u| <= force, one entry a row."""
    f, g = _corners(over.theta, over.speed[1], _plants(over))
    return np.asarray((np.abs(f) + np.abs(g) * force).max(axis=1)) + disturbed(over)


def _plants(over: OperatingSet) -> list[CartPendulum]:
    """The plants whose parameters are all as far off as the level allows."""
    scales = (1.0 - over.uncertainty, 1.0 + over.uncertainty)
    return [over.model.perturbed(np.array(corner) - 1.0) for corner in itertools.product(scales, repeat=3)]


def _corners(widest: float, fastest: float, plants: list[CartPendulum]) -> tuple[Array, Array]:
    """f2 and g2, (2, m) each, of some plants where theta' is 0 or ``fastest``, over |theta| <= ``widest``."""
    theta = np.linspace(-widest, widest, 4001)
    drifts, gains = [], []
    for plant in plants:
        for omega in (0.0, fastest):
            x = np.array([np.zeros_like(theta), theta, np.zeros_like(theta), np.full_like(theta, omega)])
            drifts.append(plant.drift(x)[2:])
            gains.append(plant.gain(x)[2:])
    return np.concatenate(drifts, axis=1), np.concatenate(gains, axis=1)


def initial_errors(starts: ArrayLike, xhat0: ArrayLike) -> tuple[Array, Array]:
    """epsilon_1 and epsilon_2 of (36)-(37), row by row (2,) each: the largest |x(0) - xhat(0)| over a box of x(0).

    Args:
        starts: [low, high], (2, 4).
        xhat0: xhat(0), (4,).
    """
    largest = np.abs(np.asarray(starts) - np.asarray(xhat0)).max(axis=0)
    return largest[:2], largest[2:]


def suprema_along(x: Array, xhat: Array, plant: CartPendulum, model: CartPendulum | None = None) -> Suprema:
    """The suprema along one measured trajectory, states and estimates (4, m)."""
    model = model or CartPendulum()
    return Suprema(
        speed=np.abs(x[2:]).max(axis=1),
        drift=np.abs(plant.drift(x) - model.drift(xhat))[2:].max(axis=1),
        gain=np.abs(plant.gain(x) - model.gain(xhat))[2:].max(axis=1),
    )


@dataclass(frozen=True, slots=True)
class Condition:
    """One inequality ``gain > supremum``, row by row and read literally."""

    name: str
    gain: Array
    supremum: Array

    @property
    def by_row(self) -> Flags:
        """Whether each row's own gain exceeds its own supremum."""
        return np.asarray(self.gain > self.supremum)

    @property
    def literal(self) -> bool:
        """Whether it holds as printed: the smaller gain against a norm over rows (Euclidean in (28), else infinity)."""
        norm = np.linalg.norm(self.supremum) if self.name == "(28)" else self.supremum.max()
        return bool(self.gain.min() > norm)


def conditions(gains: Gains, bounds: Suprema) -> list[Condition]:
    """The conditions (28), (30) and (31) for some gains."""
    return [
        Condition("(28)", np.array(gains.m1), bounds.speed),
        Condition("(30)", np.array(gains.beta_1), bounds.drift),
        Condition("(31)", np.array(gains.beta_2), bounds.gain),
    ]


def design(over: OperatingSet, margin: float = 0.1) -> Gains:
    """The smallest gains that exceed the suprema of an operating set, read literally, by a margin.

    Args:
        over: the operating set.
        margin: how much more than necessary, as a fraction.

    Raises:
        ValueError: the margin is not positive.
    """
    more = 1.0 + number("margin", margin, above=0.0)
    bounds = suprema(over)
    m1, drift, gain = (more * float(v) for v in (np.linalg.norm(bounds.speed), bounds.drift.max(), bounds.gain.max()))
    return Gains(m1=(m1, m1), beta_1=(drift, drift), beta_2=(gain, gain))


def stable(gains: Gains, slopes: Slopes, dt: float, force: float) -> SlidingModeObserver:
    """An observer with these gains and the longest step that divides the sampling period and is stable (RK4)."""
    observer = SlidingModeObserver(gains=gains, slopes=slopes)
    return SlidingModeObserver(gains=gains, slopes=slopes, step=dt / math.ceil(dt / observer.largest_step(force)))


def layer(speed: ArrayLike, m1: ArrayLike, slope: ArrayLike) -> Array:
    """Half-width of the boundary layer of the positions, atanh(|X2| / m1) / k_p, where m1 tanh(k_p e) = |X2|.

    Infinite where ``m1 <= |X2|``.
    """
    ratio = np.minimum(np.abs(np.asarray(speed)) / np.asarray(m1), 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.arctanh(ratio) / np.asarray(slope))


def position_bound(speed: ArrayLike, m1: ArrayLike, slope: ArrayLike, kappa: ArrayLike) -> Array:
    """What holds with tanh: |e(t)| <= atanh((V + kappa) / m1) / k_p from t = |e(0)| / kappa on, 0 < kappa < m1 - V.

    Outside of it m1 tanh(k_p |e|) > V + kappa, so that |e| falls faster than kappa; inside, it cannot come out.

    Args:
        speed: V, a bound of |X2|.
        m1: gain of (34).
        slope: k_p, of the tanh in it.
        kappa: how fast the error is to fall; the larger, the sooner and the wider.
    """
    return layer(np.abs(np.asarray(speed)) + np.asarray(kappa), m1, slope)


def velocity_bound(observer: SlidingModeObserver, over: OperatingSet, force: float) -> Array:
    """What |X2 - X2hat| comes below in the end, row by row: A / a + atanh(rho) / k_v.

    With d = X2 - psi2 and psi2 = m1 tanh(k_p e), d' = X2' - k_p (m1 - psi2^2 / m1) d. Where |e| has come into its
    layer, |psi2| <= V, the rate is at least a = k_p (m1 - V^2 / m1), and d comes below A / a with A = sup |X2'|. And
    while |psi2 - X2hat| > atanh(rho) / k_v, with rho the larger of sup f-error / beta_1 and sup g-error / beta_2, the
    injection of (35) exceeds what it has to overcome. The straight line between two samples adds some A dt.

    Infinite where a gain does not exceed its supremum.
    """
    gains, bounds = Gains.of(observer.gains), suprema(over)
    slope_p, slope_v = map(np.asarray, observer.slopes)
    m1, speed = np.array(gains.m1), bounds.speed
    rate = slope_p * (m1 - speed**2 / m1)
    with np.errstate(divide="ignore"):
        rho = np.maximum(bounds.drift / np.array(gains.beta_1), bounds.gain / np.array(gains.beta_2))
        tracking = np.where(speed < m1, acceleration(over, force) / np.where(speed < m1, rate, 1.0), np.inf)
    return np.asarray(tracking + layer(rho, 1.0, slope_v))


def reaching_time(error: ArrayLike, gain: ArrayLike, supremum: ArrayLike) -> Array:
    """The time of (43), ``|e(0)| / kappa`` with ``kappa = gain - supremum``; of (48) likewise, from t0 on.

    The article proves them for sgn. With tanh they are a yardstick: its rate falls off towards the layer.

    Infinite where the gain does not exceed the supremum.
    """
    kappa = np.asarray(gain) - np.asarray(supremum)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(kappa > 0.0, np.abs(error) / np.maximum(kappa, 0.0), np.inf))


def controllability(law: SlidingModeController, xhat: Array, model: CartPendulum | None = None) -> tuple[Array, Array]:
    """Both sides of (52) along estimates (4, m): ``|ds/dx g| Z0`` and ``|ds/dx f| + lambda``.

    (51) asks the first not to be 0.

    s of (50) is a sum of squares: its gradient vanishes with it, so that near s = 0 the first cannot exceed lambda.
    """
    model = model or CartPendulum()
    k1, k2, k3, k4 = law.k
    cart, rod = k1 * xhat[0] + k3 * xhat[2], k2 * xhat[1] + k4 * xhat[3]
    gradient = np.array([k1 * cart, k2 * rod, k3 * cart, k4 * rod])
    push = np.abs((gradient * model.gain(xhat)).sum(axis=0)) * law.Z0
    return push, np.abs((gradient * model.drift(xhat)).sum(axis=0)) + law.lam
