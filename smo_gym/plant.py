"""The cart pendulum: parameters, uncertainty, equations (1)-(25) on batches, energy and linearisation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .friction import Friction
from .kernels import kernel, plain
from .kernels.batch import LANES
from .kernels.blocks import ALIVE, FAILED, U, X, at, block, finite, four, offsets, put, put_four
from .kernels.cart_pendulum import answer, drift_and_gain, energy
from .kernels.cart_pendulum import plant as _plant
from .kernels.rk4 import rk4
from .loop import Loop, Part, columns
from .typing import Array
from .validation import array, mapping, number, short

STATE_NAMES = ("h", "theta", "h_dot", "theta_dot")


@dataclass(frozen=True, slots=True)
class CartPendulum:
    """Parameters of the cart pendulum, by default the article's Table 2.

    The state is x = [h, theta, h', theta'] in m, rad, m/s, rad/s and the input u = F in N. theta is measured from the
    upward vertical for ``gravity > 0``. The article prints g = -9.8 m/s^2 (Table 2), so there
    theta = 0 is the *hanging*, stable equilibrium.

    Args:
        cart_mass: M_c in kg.
        bob_mass: m in kg.
        rod_length: l in m.
        gravity: g in m/s^2, of either sign.
        friction: of cart and pivot, a :class:`~smo_gym.friction.Friction` or a mapping of its fields; none by default.

    Raises:
        ValueError: a mass or the length is not positive, or a value is not finite.
    """

    cart_mass: float = 3.5
    bob_mass: float = 0.32
    rod_length: float = 0.44
    gravity: float = -9.8
    friction: Friction = field(default_factory=Friction)

    def __post_init__(self) -> None:
        for name in ("cart_mass", "bob_mass", "rod_length"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "gravity", number("gravity", self.gravity))
        object.__setattr__(self, "friction", Friction.of(self.friction))

    def __repr__(self) -> str:
        return f"CartPendulum({', '.join(f'{name}={value!r}' for name, value in self.as_dict().items())})"

    @classmethod
    def of(
        cls,
        params: CartPendulum | Mapping[str, Any] | ArrayLike | None,
        base: CartPendulum | None = None,
        name: str = "params",
    ) -> CartPendulum:
        """A plant from a plant, a mapping of field names, an array [M_c, m, l, g] or None.

        What is left out is taken from ``base`` (Table 2 by default): by an array the friction, which a mapping gives
        as a whole. Messages call it by ``name``.

        Raises:
            ValueError: an unknown field, a wrong shape or a value that is not allowed.
        """
        base = base or cls()
        if params is None:
            return base
        if isinstance(params, CartPendulum):
            return params
        if isinstance(params, Mapping):
            return replace(base, **mapping("plant parameter", params, [f.name for f in fields(cls)]))
        M_c, m, l, g = array(name, params, (4,)).tolist()
        return cls(M_c, m, l, g, base.friction)

    def as_array(self) -> Array:
        """[M_c, m, l, g], shape (4,)."""
        return np.array([self.cart_mass, self.bob_mass, self.rod_length, self.gravity])

    def as_dict(self) -> dict[str, Any]:
        """The fields by name, as :meth:`of` takes them; friction where there is any."""
        return {name: value for name, value in asdict(self).items() if name != "friction" or self.friction}

    def perturbed(self, delta: ArrayLike) -> CartPendulum:
        """The plant whose M_c, m and l are each multiplied by ``1 + delta``, shape (3,); g and friction stay."""
        M_c, m, l = self.as_array()[:3] * (1.0 + array("delta", delta, (3,)))
        return CartPendulum(M_c, m, l, self.gravity, self.friction)

    def draw(self, uncertainty: float, rng: np.random.Generator) -> CartPendulum:
        """One uncertain plant: M_c, m and l each times U(1 - x, 1 + x) (section 6).

        Args:
            uncertainty: x in [0, 1).
            rng: where the three numbers come from.

        Raises:
            ValueError: the uncertainty is not in [0, 1).
        """
        if not 0.0 <= number("uncertainty", uncertainty) < 1.0:
            raise ValueError(f"uncertainty={uncertainty!r} must be a fraction in [0, 1)")
        return self.perturbed(uncertainty * rng.uniform(-1.0, 1.0, 3))

    def energy(self, x: ArrayLike) -> Array:
        """Kinetic and potential energy in J of states (4, ...): the integrand of equation (53).

        ``(M_c + m) h'^2 / 2 + m l^2 theta'^2 / 2 + m l h' theta' cos theta + m g l cos theta``

        It changes at the rate ``F h'`` less what friction dissipates, ``c_v h'^2 + F_C |h'| + b theta'^2`` in W.
        """
        _, theta, v, omega = _states(x)
        return np.asarray(plain(energy)(np.cos(theta), v, omega, *self.as_array()))

    def drift(self, x: ArrayLike) -> Array:
        """f(x) of equation (10) for states (4, n) or (4,), of the same shape, with the plant's viscous friction.

        Coulomb friction is no part of it: at rest it is no function of x. Observers are told [M_c, m, l, g] alone, so
        that to them all friction is uncertainty.
        """
        f, g = self._split(x)
        if self.friction:
            c, _, b = self.friction.as_array()
            v, omega = np.asarray(x, dtype=np.float64)[2:]
            f[2:] += plain(answer)(g[2], g[3], -c * v, -b * omega, *self.as_array()[:3])
        return f

    def gain(self, x: ArrayLike) -> Array:
        """g(x) of equations (16)-(18) for states (4, n) or (4,), of the same shape."""
        return self._split(x)[1]

    def _split(self, x: ArrayLike) -> tuple[Array, Array]:
        states = _states(x)
        if states.ndim > 2:
            raise ValueError(f"x has shape {states.shape}, it must have shape (4,) or (4, n)")
        batch = np.ascontiguousarray(states.reshape(4, -1))
        f, g = np.empty_like(batch), np.empty_like(batch)
        _drift_and_gain(batch, self.as_array(), f, g)
        return f.reshape(states.shape), g.reshape(states.shape)

    def linearise(self, theta: float = 0.0) -> tuple[Array, Array]:
        """A (4, 4) and B (4, 1) of ``x' = A x + B u`` about an equilibrium, theta a multiple of pi and u = 0.

        Viscous friction is part of A. Coulomb friction is not: it has no slope at rest.

        Raises:
            ValueError: ``theta`` is no multiple of pi, hence no equilibrium without force.
        """
        sign = np.cos(number("theta", theta))
        if abs(np.sin(theta)) > 1e-12:
            raise ValueError(f"theta={theta!r} must be a multiple of pi: elsewhere gravity needs a force to balance it")
        M_c, m, l, g = self.as_array()
        A = np.zeros((4, 4))
        A[0, 2] = A[1, 3] = 1.0
        A[2, 1] = -m * g / M_c
        A[3, 1] = sign * (M_c + m) * g / (M_c * l)
        B = np.array([[0.0], [0.0], [1.0 / M_c], [-sign / (M_c * l)]])
        c, _, b = self.friction.as_array()
        force, torque = np.array([[-c, 0.0], [0.0, -b]])  # by h' and by theta'
        A[2:, 2:] += plain(answer)(B[2, 0], B[3, 0], force, torque, M_c, m, l)
        return A, B


def _states(x: ArrayLike) -> Array:
    try:
        states = np.asarray(x, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"x={short(x)} must be an array of numbers of shape (4,) or (4, n)") from None
    if states.shape[:1] != (4,):
        raise ValueError(f"x has shape {states.shape}, it must have shape (4,) or (4, n)")
    return states


PARAMS, DT, _ = offsets(4, 1)


@block
def _step(signals: Array, own: Array, lanes: int) -> None:
    dt = own[DT * LANES]
    for i in range(lanes):
        x = four(signals, X, i)
        M_c, m, l, g = four(own, PARAMS, i)
        new = rk4(_plant, x, (at(signals, U, i), M_c, m, l, g), dt)
        alive, fine = at(signals, ALIVE, i) > 0.0, finite(new)
        put(signals, FAILED, i, 1.0 if alive and not fine else at(signals, FAILED, i))
        put_four(signals, X, i, new if alive and fine else x)


def moving(params: Array, dt: float) -> Part:
    """Plants [M_c, m, l, g], (4, n), that move by a Runge-Kutta step of ``dt`` seconds at every sampling instant.

    A state that would not be finite any more fails the run and stays the last finite one. Runs that have ended hold
    still.
    """
    return Part(columns(params.shape[1], params, dt), sample=_step)


def advance(x: Array, params: Array, u: Array, dt: float, samples: Array) -> None:
    """Integrate plants in place over ``len(samples)`` Runge-Kutta steps with the force held.

    Args:
        x: states (4, n), overwritten by the states at the end, the last finite ones.
        params: [M_c, m, l, g] of each slot, (4, n).
        u: force in N of each slot, (n,).
        dt: step in s.
        samples: (steps, 2, n), filled with the positions [h, theta] after each step.
    """
    loop = Loop(x.shape[1], len(samples), {"plant": moving(params, dt)})
    loop.start(slice(None), x)
    loop.u[:] = u
    loop.run(positions=samples)
    x[:] = loop.x


@kernel
def _drift_and_gain(x: Array, params: Array, f: Array, g: Array) -> None:
    M_c, m, l, gravity = params
    for i in range(x.shape[1]):
        f[0, i], f[1, i] = x[2, i], x[3, i]
        g[0, i] = g[1, i] = 0.0
        f[2, i], f[3, i], g[2, i], g[3, i] = drift_and_gain(x[1, i], x[3, i], M_c, m, l, gravity)
