"""Theorem 1 on runs: observers side by side on the same measurements, their errors against the promised times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from ..controllers import Feedback
from ..envs.vector import PendulumVectorEnv
from ..loop import Loop
from ..observers import Estimator, Gains, SlidingModeObserver
from ..theorem import OperatingSet, layer, position_bound, reaching_time, suprema, velocity_bound
from ..typing import Array, Flags
from .drivers import driven
from .traces import Watch

SHARES = np.array([0.1, 0.5, 0.9])
"""The kappa of the bound that holds with tanh, as shares of m1 - V."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """What n runs showed of the first observer, and of all of them.

    A run counts as staying while its state and the first observer's estimate are in the operating set, and its force
    within the declared one.
    """

    stayed: Flags
    """Runs that were inside the operating set throughout, (n,)."""
    promised: Array
    """Time t0 of (43) for the errors of h and theta in s, (2, n)."""
    reached: Array
    """When each position error came into its layer for good, in s, (2, n)."""
    promised_velocity: Array
    """Time t1 of (48) for the errors of h' and theta' in s, (2, n)."""
    velocity_error: Array
    """Largest errors of h' in m/s and theta' in rad/s after t1, (2, n)."""
    bounded: Flags
    """Whether each position error kept :func:`smo_gym.theorem.position_bound`, for each of SHARES, (3, 2, n)."""
    velocity_bound: Array
    """What the errors of h' in m/s and theta' in rad/s come below in the end, by ``theorem.velocity_bound``, (2,)."""
    velocity_settled: Array
    """Largest errors of h' in m/s and theta' in rad/s after the settling time, (2, n)."""
    squares: dict[str, Array]
    """Squared errors of h' and theta' summed over the control instants after the settling time, (2, n) by observer."""
    settled_instants: int
    """How many instants these are."""
    largest: Array
    """Largest |theta|, |h'|, |theta'|, their estimates and |u| over all runs in rad, m/s, rad/s and N, (7,)."""
    horizon: float
    """Length of the runs in s: what was promised for later was not tested."""

    @property
    def velocity_rms(self) -> dict[str, Array]:
        """RMS errors of h' in m/s and theta' in rad/s after the settling time, over runs that stayed, by observer."""
        n = self.settled_instants
        return {name: np.sqrt(total[:, self.stayed].mean(axis=1) / n) for name, total in self.squares.items()}

    @property
    def tested(self) -> Flags:
        """Runs that stayed in the operating set and outlasted both promised times, (n,)."""
        return self.stayed & (self.promised < self.horizon).all(axis=0)

    @property
    def kept(self) -> Flags:
        """Runs whose position errors were both in their layers from the promised times on, (n,)."""
        return np.asarray((self.reached <= self.promised).all(axis=0))


def converge(
    observers: Mapping[str, SlidingModeObserver],
    agent: Feedback,
    over: OperatingSet,
    starts: Array,
    plants: Array,
    *,
    force: float,
    horizon: float,
    settle: float,
    dt: float = 0.001,
    progress: Callable[[int], object] = lambda steps: None,
) -> Convergence:
    """Run a closed loop on the first observer's estimate, with all observers on its measurements and forces.

    Args:
        observers: by name; the first one feeds the agent.
        agent: control law.
        over: the operating set, whose suprema give kappa_1, kappa_2 and the layer.
        starts: x(0), (n, 4).
        plants: [M_c, m, l, g], (n, 4).
        force: that the observers' steps are stable up to, in N.
        horizon: of the runs in s.
        settle: where the RMS of the velocity errors begins, in s.
        dt: sampling and control period in s.
        progress: called with the number of samples done since the last call.

    Raises:
        ValueError: the first observer's m1 does not exceed the speeds of the operating set: nothing is promised.
    """
    if not (np.array(next(iter(observers.values())).gains.m1) > over.speed).all():  # type: ignore[union-attr]
        raise ValueError(f"the first observer's m1 must exceed the speeds {over.speed} of the operating set, (28)")
    n = len(starts)
    env = gymnasium.make_vec(
        "SMOPendulum-v0",
        n,
        autoreset_mode=AutoresetMode.DISABLED,
        control_period=dt,
        dt=dt,
        horizon=horizon,
        force_limit=None,
        track_limit=None,
    )
    inner = cast(PendulumVectorEnv, env.unwrapped)
    name, first = next(iter(observers.items()))
    inner.plug(first.part(n, dt, force, over.model))
    env.reset(options={"state": starts, "params": plants})
    inner.loop.restart("observer", slice(None))
    others = {other: o.start(n, dt, force, over.model) for other, o in observers.items() if other != name}
    for estimator in others.values():
        estimator.reset(np.ones(n, dtype=np.bool_), inner.loop.y)
    counters = _Counters(name, first, others, over, force, settle, dt, inner.loop)
    driven(inner, agent, {}, Watch([counters], progress))
    return counters.found(horizon)


class _Counters:
    """Looks on at every control instant."""

    every = 1

    def __init__(
        self,
        name: str,
        first: SlidingModeObserver,
        others: Mapping[str, Estimator],
        over: OperatingSet,
        force: float,
        settle: float,
        dt: float,
        loop: Loop,
    ) -> None:
        self._name, self._first, self._others = name, first, others
        self._over, self._force, self._settle, self._dt = over, force, settle, dt
        self._gains = Gains.of(first.gains)
        self._bounds = suprema(over)
        self._half = layer(self._bounds.speed, self._gains.m1, first.slopes[0])[:, None]
        self._count = 0
        x, xhat, n = loop.x.copy(), loop.xhat.copy(), loop.n
        m1, speed = np.array(self._gains.m1), self._bounds.speed
        self._promised = reaching_time(x[:2] - xhat[:2], m1[:, None], speed[:, None])
        kappa = SHARES[:, None] * (m1 - speed)
        self._bound = position_bound(speed, self._gains.m1, self._first.slopes[0], kappa)[:, :, None]
        self._bound_from = np.abs(x[:2] - xhat[:2]) / kappa[:, :, None]
        self._bounded, self._settled = np.ones((len(SHARES), 2, n), dtype=np.bool_), np.zeros((2, n))
        self._promised_velocity = np.full((2, n), np.nan)
        self._stayed = self._over.holds(x, xhat)
        self._reached, self._velocity_error = np.zeros((2, n)), np.full((2, n), np.nan)
        self._largest = np.zeros(7)
        self._squares = {name: np.zeros((2, n)) for name in (self._name, *self._others)}

    def look(self, k: int, loop: Loop) -> None:
        """Count what this instant shows."""
        if k == 0:
            return
        x, xhat, u, time = loop.x.copy(), loop.xhat.copy(), loop.u.copy(), k * self._dt
        for estimator in self._others.values():
            estimator.update(loop.y[None].copy(), u)
        self._stayed &= self._over.holds(x, xhat) & (np.abs(u) <= self._force)
        self._largest = np.maximum(self._largest, np.abs(np.concatenate([x[1:], xhat[1:], u[None]])).max(axis=1))
        offset = np.abs(x[:2] - xhat[:2])
        self._reached = np.where(offset > self._half, time, self._reached)
        self._bounded &= (time < self._bound_from) | (offset <= self._bound)
        error = np.abs(x[2:] - xhat[2:])
        at_t0 = np.isnan(self._promised_velocity) & (time >= self._promised)
        t1 = self._promised + reaching_time(error, np.array(self._gains.beta_1)[:, None], self._bounds.drift[:, None])
        self._promised_velocity = np.where(at_t0, t1, self._promised_velocity)
        late = time >= self._promised_velocity
        self._velocity_error = np.where(late, np.fmax(self._velocity_error, error), self._velocity_error)
        if time >= self._settle:
            self._count += 1
            self._settled = np.maximum(self._settled, error)
            self._squares[self._name] += (x[2:] - xhat[2:]) ** 2
            for name, estimator in self._others.items():
                self._squares[name] += (x[2:] - estimator.xhat[2:]) ** 2

    def found(self, horizon: float) -> Convergence:
        """What the runs showed."""
        stayed, count = self._stayed, self._count
        return Convergence(
            stayed=stayed,
            promised=self._promised,
            reached=self._reached,
            promised_velocity=self._promised_velocity,
            velocity_error=self._velocity_error,
            bounded=self._bounded,
            velocity_bound=velocity_bound(self._first, self._over, self._force),
            velocity_settled=self._settled,
            squares=self._squares,
            settled_instants=count,
            largest=self._largest,
            horizon=horizon,
        )
