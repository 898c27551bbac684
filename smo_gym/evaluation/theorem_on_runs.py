"""Theorem 1 on runs: observers side by side on the same measurements, their errors against the promised times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ..controllers import Agent
from ..observers import Period, SlidingModeObserver
from ..theorem import OperatingSet, layer, position_bound, reaching_time, suprema, velocity_bound
from ..typing import Array, Flags

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
    """t0 of (43) for h and theta in s, (2, n)."""
    reached: Array
    """When each position error came into its layer for good, in s, (2, n)."""
    promised_velocity: Array
    """t1 of (48) in s, (2, n)."""
    velocity_error: Array
    """Largest |velocity error| after t1, (2, n)."""
    bounded: Flags
    """Whether each position error kept :func:`smo_gym.theorem.position_bound`, for each of SHARES, (3, 2, n)."""
    velocity_bound: Array
    """What the velocity errors come below in the end, :func:`smo_gym.theorem.velocity_bound`, (2,)."""
    velocity_settled: Array
    """Largest |velocity error| after the settling time, (2, n)."""
    velocity_rms: dict[str, Array]
    """RMS errors of h' and theta' over all runs that stayed, after the settling time, observer by observer, (2,)."""
    largest: Array
    """Largest |theta|, |h'|, |theta'|, their estimates and |u| over all runs, (7,)."""
    horizon: float
    """Of the runs in s: what was promised for later was not tested."""

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
    agent: Agent,
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
        agent: control law on [h, theta, xhat].
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
    n, steps = len(starts), round(horizon / dt)
    env: VectorEnv[Array, Array, Array] = gymnasium.make_vec(
        "SMOPendulum-v0",
        n,
        autoreset_mode=AutoresetMode.DISABLED,
        control_period=dt,
        dt=dt,
        horizon=horizon,
        force_limit=None,
        track_limit=None,
    )
    y, info = env.reset(options={"state": starts, "params": plants})
    estimators: dict[str, Any] = {name: o.start(n, dt, force, over.model) for name, o in observers.items()}
    first, watched = next(iter(observers)), next(iter(estimators.values()))
    gains: Any = observers[first].gains
    bounds = suprema(over)
    half = layer(bounds.speed, gains.m1, observers[first].slopes[0])[:, None]
    x = info["state"].T
    promised = reaching_time(x[:2] - watched.xhat[:2], np.array(gains.m1)[:, None], bounds.speed[:, None])
    kappa = SHARES[:, None] * (np.array(gains.m1) - bounds.speed)
    bound = position_bound(bounds.speed, gains.m1, observers[first].slopes[0], kappa)[:, :, None]
    bound_from = np.abs(x[:2] - watched.xhat[:2]) / kappa[:, :, None]
    bounded, settled = np.ones((len(SHARES), 2, n), dtype=np.bool_), np.zeros((2, n))
    promised_velocity = np.full((2, n), np.nan)
    stayed = over.holds(x, watched.xhat)
    reached, velocity_error = np.zeros((2, n)), np.full((2, n), np.nan)
    largest = np.zeros(7)
    squares, count = {name: np.zeros((2, n)) for name in observers}, 0
    for k in range(1, steps + 1):
        action, _ = agent.predict(np.concatenate([y, watched.xhat.T], axis=1))
        y_before = y.T.copy()
        y, _, _, _, info = env.step(action)
        x, time = np.ascontiguousarray(info["state"].T), k * dt
        samples = np.ascontiguousarray(info["samples"].transpose(1, 2, 0))
        for estimator in estimators.values():
            estimator.update(Period(y_before, samples, info["force"], x))
        xhat = watched.xhat
        u = info["force"]
        stayed &= over.holds(x, xhat) & (np.abs(u) <= force)
        largest = np.maximum(largest, np.abs(np.concatenate([x[1:], xhat[1:], u[None]])).max(axis=1))
        reached = np.where(np.abs(x[:2] - xhat[:2]) > half, time, reached)
        bounded &= (time < bound_from) | (np.abs(x[:2] - xhat[:2]) <= bound)
        error = np.abs(x[2:] - xhat[2:])
        at_t0 = np.isnan(promised_velocity) & (time >= promised)
        t1 = promised + reaching_time(error, np.array(gains.beta_1)[:, None], bounds.drift[:, None])
        promised_velocity = np.where(at_t0, t1, promised_velocity)
        velocity_error = np.where(time >= promised_velocity, np.fmax(velocity_error, error), velocity_error)
        if time >= settle:
            count += 1
            settled = np.maximum(settled, error)
            for name, estimator in estimators.items():
                squares[name] += (x[2:] - estimator.xhat[2:]) ** 2
        if k % 100 == 0:
            progress(100)
    progress(steps % 100)
    return Convergence(
        stayed=stayed,
        promised=promised,
        reached=reached,
        promised_velocity=promised_velocity,
        velocity_error=velocity_error,
        bounded=bounded,
        velocity_bound=velocity_bound(observers[first], over, force),
        velocity_settled=settled,
        velocity_rms={name: np.sqrt(total[:, stayed].mean(axis=1) / count) for name, total in squares.items()},
        largest=largest,
        horizon=horizon,
    )
