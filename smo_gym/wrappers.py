"""Append the estimate of the state to what the environment observes: the scalar wrapper and its vector twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from .envs.task import Task
from .observers import OBSERVERS, Observer, Period, SlidingModeObserver
from .observers.protocol import Estimator
from .validation import choice, unknown

Array = NDArray[np.float64]
# A force without limit bounds nothing: the step is then checked for the largest that the article's runs reach.
_USUAL_FORCE = 30.0


def make_observer(observer: str | Observer, compensation: bool, settings: dict[str, Any]) -> Observer:
    """An observer by name, or the object itself.

    Raises:
        ValueError: an unknown name or setting, or settings beside an object that has its own.
    """
    if not isinstance(observer, str):
        if settings:
            raise ValueError(f"{sorted(settings)} are settings of a named observer; {observer!r} has its own")
        return observer
    cls = OBSERVERS[choice("observer", observer, OBSERVERS)]
    known = {field.name for field in fields(cls)}
    for name in settings:
        if name not in known:
            raise ValueError(unknown(f"setting of the observer {observer!r}", name, known))
    if "compensation" in known:
        settings = {"compensation": compensation, **settings}
    return cast(Observer, cls(**settings))


def _task(env: Any) -> Task:
    base = env.unwrapped
    try:  # a batch of scalar environments has one task each, all alike
        task = base.get_attr("task")[0] if isinstance(base, (SyncVectorEnv, AsyncVectorEnv)) else base.task
    except AttributeError:
        task = None
    if not isinstance(task, Task):
        raise TypeError(f"{env} is no smo_gym environment: an observer needs its sampling period and its samples")
    return task


def _bound(task: Task) -> float:
    return task.force_limit if np.isfinite(task.force_limit) else _USUAL_FORCE


def _space(inner: spaces.Space[Any]) -> spaces.Space[Array]:
    assert isinstance(inner, spaces.Box)
    return spaces.Box(-np.inf, np.inf, (inner.shape[0] + 4,), np.float64)


class ObserverWrapper(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """The observation becomes [h, theta, hhat, thetahat, hhat', thetahat'].

    An observer needs the force as well as the measurement, so this is no ``ObservationWrapper``; it must stand inside
    wrappers that rescale the action. It uses what a real observer would have: the encoders' samples, the applied
    force, nominal parameters and gains. At ``reset`` the estimate is ``xhat0`` (zero by default, as in the article).

    Args:
        env: ``SMOPendulum-v0`` or ``SMOPendulumUpright-v0``.
        observer: "smo" (:class:`~smo_gym.SlidingModeObserver`), "oracle" (the true state) or an
            :class:`~smo_gym.observers.Observer`.
        compensation: of the input uncertainty, for "smo" (Remark 3).
        **settings: of the named observer, such as ``gains``, ``slopes``, ``time_constant``, ``step``, ``xhat0``. The
            model of "smo" is the environment's nominal plant unless given.

    Raises:
        TypeError: the environment is not one of this package.
        ValueError: an unknown observer or setting, or a step that the observer is not stable at.
    """

    def __init__(
        self,
        env: gymnasium.Env[Array, Array],
        observer: str | Observer = "smo",
        compensation: bool = True,
        **settings: Any,
    ) -> None:
        RecordConstructorArgs.__init__(self, observer=observer, compensation=compensation, **settings)
        gymnasium.Wrapper.__init__(self, env)
        task = _task(env)
        self.observer = _with_model(observer, compensation, settings, task)
        self._estimator = self.observer.start(1, task.dt, _bound(task))
        self._everywhere = np.ones(1, dtype=np.bool_)
        self.observation_space = _space(env.observation_space)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start the episode and the estimate."""
        y, info = self.env.reset(seed=seed, options=options)
        self._estimator.reset(self._everywhere)
        return self._observation(y), info

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Run a control period and bring the estimate to its end."""
        y, reward, terminated, truncated, info = self.env.step(action)
        period = Period(
            y=self._y[:, None],
            samples=info["samples"][:, :, None],
            u=np.array([info["force"]]),
            truth=info["state"][:, None],
        )
        self._estimator.update(period)
        return self._observation(y), reward, terminated, truncated, info

    def _observation(self, y: Array) -> Array:
        self._y = y
        return np.concatenate([y, self._estimator.xhat[:, 0]])


class VectorObserverWrapper(VectorWrapper[Array, Array, Array, Array, Array], RecordConstructorArgs):
    """The vector twin of :class:`ObserverWrapper`, for the native vector environment and for Gymnasium's own.

    ``observer`` may also be a sequence with one :class:`~smo_gym.SlidingModeObserver` a slot, which puts arms of a
    comparison side by side in one batch. All three autoreset modes work; in SAME_STEP ``info["final_obs"]`` carries
    the last estimate of the episode too.
    """

    def __init__(
        self,
        env: VectorEnv[Array, Array, Array],
        observer: str | Observer | Sequence[SlidingModeObserver] = "smo",
        compensation: bool = True,
        **settings: Any,
    ) -> None:
        RecordConstructorArgs.__init__(self, observer=observer, compensation=compensation, **settings)
        VectorWrapper.__init__(self, env)
        task = _task(env)
        n, bound = env.num_envs, _bound(task)
        self._estimator: Estimator
        if isinstance(observer, Sequence) and not isinstance(observer, str):
            if len(observer) != n:
                raise ValueError(f"observer has {len(observer)} entries for {n} slots")
            self._estimator = SlidingModeObserver.start_each(observer, task.dt, bound)
        else:
            self._estimator = _with_model(observer, compensation, settings, task).start(n, task.dt, bound)
        self._mode = env.metadata["autoreset_mode"]
        self._over = np.zeros(n, dtype=np.bool_)
        self.single_observation_space = _space(env.single_observation_space)
        self.observation_space = spaces.Box(-np.inf, np.inf, (n, 6), np.float64)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start the episodes and their estimates."""
        started = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        y, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self._estimator.reset(started)
        self._over[started] = False
        return self._observation(y), info

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Run a control period and bring the estimates to its end."""
        y, reward, terminated, truncated, info = self.env.step(actions)
        ended = np.logical_or(terminated, truncated)
        same_step = self._mode is AutoresetMode.SAME_STEP
        restarted = ended if same_step else self._over
        any_restarted = np.count_nonzero(restarted) > 0
        last = _at_the_end(info) if same_step and any_restarted else info
        period = Period(
            y=self._y,
            samples=np.ascontiguousarray(last["samples"].transpose(1, 2, 0)),
            u=last["force"],
            truth=np.ascontiguousarray(last["state"].T),
        )
        self._estimator.update(period)
        if same_step and any_restarted:
            final_obs = info["final_obs"]
            for i in np.flatnonzero(ended):
                final_obs[i] = np.concatenate([final_obs[i], self._estimator.xhat[:, i]])
        if any_restarted and self._mode is not AutoresetMode.DISABLED:
            self._estimator.reset(restarted)
        self._over = ended
        return self._observation(y), reward, terminated, truncated, info

    def _observation(self, y: Array) -> Array:
        self._y = y.T.copy()
        observation = np.empty((len(y), 6))
        observation[:, :2] = y
        observation[:, 2:] = self._estimator.xhat.T
        return observation


def _with_model(observer: str | Observer, compensation: bool, settings: dict[str, Any], task: Task) -> Observer:
    """The observer, with the environment's nominal plant as the model of the named one unless another is given."""
    if observer == "smo":
        settings = {"model": task.params, **settings}
    return make_observer(observer, compensation, settings)


def _at_the_end(info: dict[str, Any]) -> dict[str, Any]:
    """What slots that ended in this very step (SAME_STEP) gave last, beside what the others gave."""
    final = info["final_info"]
    merged = {}
    for key in ("samples", "force", "state"):
        merged[key] = info[key].copy()
        ended = final[f"_{key}"]
        merged[key][ended] = final[key][ended]
    return merged
