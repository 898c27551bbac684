"""Moving horizon estimation: what the model and the last samples have to say, solved anew at each of them."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.linearised import halfway, jacobian, process_noise, ratio, transition
from ..kernels.matrices import Symmetric
from ..kernels.rk4 import rk4, steps_of
from ..models import Model, known
from ..plant import CartPendulum
from ..typing import Array, Flags, State
from ..validation import positive_pair, whole
from .recorded import checked, periods

_UPPER = np.triu_indices(4)
_SHIFT = 2.0**-17  # of central differences


@dataclass(frozen=True, slots=True)
class MovingHorizon:
    """Estimates the last N + 1 states at once: those that fit model, noise and N samples best.

    ::

        min |X_0 - xbar|^2_P + sum_k |X_k+1 - f(X_k, u_k)|^2_Q + sum_k |y_k - H X_k|^2_R,    |e|^2_S = e' S^-1 e

    where f integrates the model over a sampling period and Q, R are the noise of
    :class:`~smo_gym.observers.kalman.ExtendedKalmanFilter`. What was before the window is in the arrival cost: xbar is
    what was estimated at its first sample when that was the newest, P the extended filter's covariance there. On a
    linear model the last X is the Kalman filter's; on another one no sample of the window is linearised for good. Rao,
    Rawlings and Mayne, IEEE Transactions on Automatic Control 48 (2003).

    It solves a nonlinear least squares problem a sample (Levenberg-Marquardt), in Python, which takes milliseconds: a
    bound of what can be had, not an observer to control with. It does not run inside of the compiled loop.

    Args:
        horizon: N, samples in the window.
        acceleration: square roots of the power spectral densities of both accelerations' noise, in m/s^2/sqrt(Hz) and
            rad/s^2/sqrt(Hz).
        noise: standard deviations of the measured positions in m and rad.
        velocity: standard deviations of the initial velocities, which are taken to be 0, in m/s and rad/s.
        model: nominal plant; None for the one that the environment draws its plants around.

    Raises:
        ValueError: a value is not allowed.
    """

    horizon: int = 10
    acceleration: tuple[float, float] = (0.5, 2.0)
    noise: tuple[float, float] = (3e-5, 4.5e-4)
    velocity: tuple[float, float] = (1.0, 3.0)
    model: Model | CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "horizon", whole("horizon", self.horizon, 1))
        for name in ("acceleration", "noise", "velocity"):
            object.__setattr__(self, name, positive_pair(name, getattr(self, name)))
        object.__setattr__(self, "model", known(self.model))

    def start(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Windows:
        """An estimator for n slots, one problem each."""
        return Windows([_Window(self, Model.of(self.model or nominal), dt) for _ in range(n)], dt)

    def run(
        self,
        t: ArrayLike,
        y: ArrayLike,
        u: ArrayLike,
        model: Model | CartPendulum | None = None,
        force: float | None = None,
    ) -> Array:
        """Estimates along a recording, (samples, 4), as :func:`~smo_gym.observers.recorded.run` of others."""
        times, positions, inputs = checked(t, y, u)
        dt, h = periods(times)
        estimator = self.start(1, dt, 0.0, model or CartPendulum())
        estimator.reset(np.ones(1, dtype=np.bool_), positions[0, :, None])
        xhat = [estimator.xhat[:, 0]]
        for k in range(1, len(times)):
            estimator.update(positions[k, :, None][None], inputs[k - 1 : k], elapsed=h[k])
            xhat.append(estimator.xhat[:, 0])
        return np.array(xhat)


class Windows:
    """An estimator of n slots."""

    def __init__(self, slots: list[_Window], dt: float) -> None:
        self._slots, self._dt = slots, dt

    @property
    def xhat(self) -> Array:
        """The estimates (4, n), a copy."""
        return np.array([slot.path[-1] for slot in self._slots]).T

    def reset(self, slots: Flags, y: Array) -> None:
        """Start the marked slots anew."""
        for i in np.flatnonzero(slots):
            self._slots[i].start(y[:, i])

    def update(self, samples: Array, u: Array, elapsed: float | None = None) -> None:
        """Bring the estimates to the end of a control period, of samples ``elapsed`` seconds apart."""
        for y in samples:
            for i, slot in enumerate(self._slots):
                slot.update(float(u[i]), y[:, i], self._dt if elapsed is None else elapsed)


class _Window:
    """One slot's samples, the states at them, and what was estimated when each was the newest."""

    def __init__(self, settings: MovingHorizon, model: Model, dt: float) -> None:
        self._settings, self._model, self._dt = settings, model, dt
        self._density = settings.acceleration[0] ** 2, settings.acceleration[1] ** 2
        self.start(np.zeros(2))

    def start(self, y: Array) -> None:
        horizon, both = self._settings.horizon, [*self._settings.noise, *self._settings.velocity]
        self.path = np.array([[*y, 0.0, 0.0]])
        self._samples: deque[tuple[float, float, Array]] = deque(maxlen=horizon)
        self._estimated: deque[tuple[Array, Array]] = deque([(self.path[0], np.diag(np.square(both)))], maxlen=horizon)

    def update(self, u: float, y: Array, h: float) -> None:
        self._samples.append((u, h, y))
        newest, F, Q = self._predicted(self.path[-1], u, h)
        guess = np.vstack([self.path[-len(self._samples) :], newest])
        solvable = np.isfinite(guess).all() and np.isfinite(y).all()
        self.path = self._solved(guess) if solvable else np.full_like(guess, np.nan)
        P = F @ self._estimated[-1][1] @ F.T + Q
        gain = np.linalg.solve(P[:2, :2] + np.diag(np.square(self._settings.noise)), P[:2]).T
        self._estimated.append((self.path[-1], P - gain @ P[:2]))

    def _moved(self, x: Array, u: float, h: float) -> State:
        """The state after h."""
        steps, step = steps_of(h, self._dt)
        state = _numbers(x)
        for _ in range(steps):
            state = rk4(self._model.rhs, state, (u, *self._model.params), step)
        return state

    def _slopes(self, x: Array, u: float, h: float) -> Array:
        """How the state after h depends on the one before, (4, 4)."""
        shifts = _SHIFT * np.eye(4)
        return np.array(
            [np.subtract(self._moved(x + d, u, h), self._moved(x - d, u, h)) / (2.0 * _SHIFT) for d in shifts]
        ).T

    def _predicted(self, x: Array, u: float, h: float) -> tuple[State, Array, Array]:
        """As the extended filter has it: the state after h, its transition, and the covariance of what noise adds."""
        rhs, p = self._model.rhs, self._model.params
        steps, step = steps_of(h, self._dt)
        state, F, Q = _numbers(x), np.eye(4), np.zeros((4, 4))
        for _ in range(steps):
            new = rk4(rhs, state, (u, *p), step)
            middle = halfway(state, new)
            f = np.array(transition(jacobian(rhs, middle, u, p), step))
            F, Q = f @ F, f @ Q @ f.T + _matrix(process_noise(self._density, ratio(rhs, middle, u, p), step))
            state = new
        return state, F, Q

    def _solved(self, guess: Array) -> Array:
        """The best states, from a guess of them."""
        from scipy.optimize import least_squares  # brings much that nobody else needs

        n, (mean, P), noise = len(self._samples), self._estimated[0], np.array(self._settings.noise)
        inputs, y = [(u, h) for u, h, _ in self._samples], np.array([y for _, _, y in self._samples])
        Q = [self._predicted(x, *between)[2] for x, between in zip(guess[:-1], inputs, strict=True)]
        weights = np.linalg.inv(np.linalg.cholesky([P, *Q]))

        def residuals(states: Array) -> Array:
            X = states.reshape(-1, 4)
            moved = [self._moved(x, *between) for x, between in zip(X[:-1], inputs, strict=True)]
            unexpected = weights @ (X - np.vstack([mean, *moved]))[:, :, None]
            return np.concatenate([unexpected.ravel(), ((X[1:, :2] - y) / noise).ravel()])

        def slopes(states: Array) -> Array:
            X = states.reshape(-1, 4)
            model, sensor = np.zeros((n + 1, 4, n + 1, 4)), np.zeros((n, 2, n + 1, 4))
            for k, between in enumerate(inputs):
                model[k + 1, :, k] = -weights[k + 1] @ self._slopes(X[k], *between)
                sensor[k, :, k + 1, :2] = np.diag(1.0 / noise)
            for k, weight in enumerate(weights):
                model[k, :, k] = weight
            return np.vstack([each.reshape(-1, 4 * n + 4) for each in (model, sensor)])

        found: Array = least_squares(residuals, guess.ravel(), slopes, method="lm").x
        return found.reshape(-1, 4)


def _numbers(x: Array) -> State:
    a, b, c, d = x.tolist()
    return a, b, c, d


def _matrix(P: Symmetric) -> Array:
    """A symmetric matrix from its upper triangle."""
    full = np.zeros((4, 4))
    full[_UPPER] = P
    return full + np.triu(full, 1).T
