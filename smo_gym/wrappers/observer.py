"""Append the estimate of the state to what the environment observes: the scalar wrapper and its vector twin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import (
    AsyncVectorEnv,
    AutoresetMode,
    SyncVectorEnv,
    VectorEnv,
    VectorObservationWrapper,
    VectorWrapper,
)

from ..envs.pendulum import PendulumEnv
from ..envs.task import Task, plain_data
from ..envs.vector import PendulumVectorEnv, only
from ..observers import OBSERVERS, Observer, Oracle, Period, SlidingModeObserver
from ..typing import Array, Flags
from ..validation import choice, short, unknown

# A force without limit bounds nothing: the step is then checked for the largest that the article's runs reach.
_USUAL_FORCE = 30.0


def make_observer(observer: str | Observer, compensation: bool | None, settings: dict[str, Any]) -> Observer:
    """An observer by name and settings, or the object itself, which has its own.

    Raises:
        TypeError: neither a name nor an observer.
        ValueError: an unknown name or setting, or settings beside an object.
    """
    if not isinstance(observer, str):
        if not hasattr(observer, "start"):
            raise TypeError(f"observer={observer!r} must be one of {', '.join(map(repr, OBSERVERS))} or an Observer")
        if settings or compensation is not None:
            given = [*settings, *["compensation"] * (compensation is not None)]
            raise ValueError(f"{', '.join(given)} must not be given beside {observer!r}, which has its own settings")
        return observer
    cls = OBSERVERS[choice("observer", observer, OBSERVERS)]
    known = {field.name for field in fields(cls)}
    for name in settings:
        if name not in known:
            raise ValueError(unknown(f"setting of the observer {observer!r}", name, known))
    if "compensation" in known and compensation is not None:
        settings = {"compensation": compensation, **settings}
    return cast(Observer, cls(**settings))


def _named(observer: Any, compensation: bool | None, settings: dict[str, Any]) -> dict[str, Any]:
    """The constructor's arguments as plain data, so that a spec survives JSON."""
    if isinstance(observer, SlidingModeObserver):
        return {"observer": "smo", **plain_data(observer.as_dict())}
    if isinstance(observer, Oracle):
        return {"observer": "oracle"}
    return {"observer": observer, "compensation": compensation, **plain_data(settings)}


UNSEEN = (
    "an observer reads what the encoders measured, info['samples'], and would not see this. Noise, quantisation or "
    "delay of a sensor belongs into a wrapper inside that changes info['samples'] and the observation alike; a change "
    "that is meant for the agent alone belongs outside the observer"
)


def task_of(env: Any, batch: bool | None = None) -> Task:
    """The task of an environment that observes what its task tells and no more.

    Args:
        env: the environment, scalar or vector.
        batch: whether it must be the one or the other.

    Raises:
        TypeError: the environment is not one of this package, or scalar where a vector is wanted, or the reverse.
        ValueError: its slots have different tasks, or something changes what it observes.
    """
    if not isinstance(env, gymnasium.Env | VectorEnv):
        raise TypeError(f"env={short(env)} must be a smo_gym environment, as gymnasium.make or make_vec gives it")
    if batch is not None and batch != isinstance(env, VectorEnv):
        kind = "VectorObserverWrapper (or VectorAgentView)" if not batch else "ObserverWrapper (or agent_view)"
        raise TypeError(f"{env} is {'one environment' if batch else 'a batch'}: wrap it in {kind}")
    layer: Any = env
    while isinstance(layer, gymnasium.Wrapper | VectorWrapper):
        if isinstance(layer, gymnasium.ObservationWrapper | VectorObservationWrapper):
            raise ValueError(f"{layer} changes the observation: {UNSEEN}")
        layer = layer.env
    base = env.unwrapped
    many = isinstance(base, SyncVectorEnv | AsyncVectorEnv)
    try:
        task, *others = base.get_attr("task") if many else [base.task]  # type: ignore[union-attr]
    except AttributeError:
        task, others = None, []
    if not isinstance(task, Task):
        raise TypeError(f"{env} is not a smo_gym environment: an observer needs its sampling period and samples")
    if any(other != task for other in others):
        raise ValueError(f"{env} has environments with different options: one wrapper serves alike ones")
    space = env.single_observation_space if isinstance(env, VectorEnv) else env.observation_space
    if space.shape != task.observation_space.shape:
        raise ValueError(f"{env} observes {space}: an observer or view must stand inside whatever else changes that")
    return task


def _unseen(observation: Array, y: Array) -> ValueError:
    """What there is to say where the observation is not what the encoders measured."""
    return ValueError(f"the environment observes {short(observation)} where {short(y)} was measured: {UNSEEN}")


def _lost(xhat: Array) -> Flags | None:
    """Which estimates (4, n) are not finite, (n,); None where all are."""
    finite = np.isfinite(xhat)
    return None if np.count_nonzero(finite) == finite.size else np.asarray(~finite.all(axis=0))


def _force(task: Task) -> float:
    return task.force_limit if np.isfinite(task.force_limit) else _USUAL_FORCE


def _space(inner: spaces.Space[Any]) -> spaces.Space[Array]:
    assert isinstance(inner, spaces.Box)
    return spaces.Box(-np.inf, np.inf, (*inner.shape[:-1], inner.shape[-1] + 4), np.float64)


class ObserverWrapper(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """The estimate is appended: the observation becomes [h, theta, hhat, thetahat, hhat', thetahat'].

    Where there is a reference to track, what the environment tells of it stands between the two.

    An observer needs the force as well as the measurement, so this is no ``ObservationWrapper``. It uses what a real
    observer would have: the encoders' samples and the applied force (``info``), the nominal plant and its gains. At
    ``reset`` the estimate is ``xhat0`` (zero by default, as in the article). Put wrappers that rescale the action
    outside: the control laws of this package give newtons.

    An estimate can grow beyond all bounds in finite time. One that is not finite any more starts anew, as at a reset,
    and ``info["estimate_failed"]`` is true for that step; observations are always finite.

    Without a force limit the observer's step is checked for forces up to 30 N, about what the article's runs reach.

    Frames show the estimate as a ghost beside the state.

    Args:
        env: an environment of this package.
        observer: "smo" (:class:`~smo_gym.SlidingModeObserver`), "oracle" (the true state) or an
            :class:`~smo_gym.observers.Observer`.
        compensation: of the input uncertainty, for "smo" (Remark 3); None for its default, which is True.
        **settings: of the named observer, such as ``gains``, ``slopes``, ``time_constant``, ``step``, ``xhat0``.

    Raises:
        TypeError: the environment is not one of this package, or ``observer`` is not an observer.
        ValueError: an unknown observer or setting, settings beside an object, a step that the observer is not
            stable at, or a wrapper inside that changes what the encoders measured (seen at once, or at the first
            observation that differs).
    """

    def __init__(
        self,
        env: gymnasium.Env[Array, Array],
        observer: str | Observer = "smo",
        compensation: bool | None = None,
        **settings: Any,
    ) -> None:
        task = task_of(env, batch=False)
        RecordConstructorArgs.__init__(self, **_named(observer, compensation, settings))
        gymnasium.Wrapper.__init__(self, env)
        self.observer = make_observer(observer, compensation, settings)
        self._estimator = self.observer.start(1, task.dt, _force(task), task.params)
        self._every = np.ones(1, dtype=np.bool_)
        self._show = cast(PendulumEnv, env.unwrapped).show
        self._show(self._estimator.xhat[:, 0])
        self.observation_space = _space(env.observation_space)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start the episode and the estimate."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._estimator.reset(self._every, info["state"][:, None])
        return self._append(observation, info, self._estimator.xhat[:, 0], False), info

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Run a control period and bring the estimate to its end."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        samples, force, state = info["samples"], info["force"], info["state"]
        self._estimator.update(Period(self._y, samples[:, :, None], np.array([force]), state[:, None]))
        xhat = self._estimator.xhat
        lost = not all(map(math.isfinite, xhat[:, 0].tolist()))
        if lost:
            self._estimator.reset(self._every, state[:, None])
            xhat = self._estimator.xhat
        return self._append(observation, info, xhat[:, 0], lost), reward, terminated, truncated, info

    def _append(self, observation: Array, info: dict[str, Any], xhat: Array, lost: bool) -> Array:
        y = info["samples"][-1]
        if observation[0] != y[0] or observation[1] != y[1]:
            raise _unseen(observation[:2], y)
        self._y = y[:, None].copy()
        info["estimate_failed"] = lost
        self._show(xhat)
        return np.concatenate([observation, xhat])


class VectorObserverWrapper(VectorWrapper[Array, Array, Array, Array, Array], RecordConstructorArgs):
    """The vector twin of :class:`ObserverWrapper`, for the native vector environments and for Gymnasium's own.

    All three autoreset modes work; in SAME_STEP ``info["final_obs"]`` carries the last estimate of the episode too.
    ``info["estimate_failed"]`` (n,) tells the slots whose estimate was lost in this step and started anew.

    Args:
        env: a vector environment of this package, or Gymnasium's vector environment of scalar ones.
        observer: as for :class:`ObserverWrapper`; or a sequence with one :class:`~smo_gym.SlidingModeObserver` a slot,
            which puts arms of a comparison side by side in one batch.
        compensation: as for :class:`ObserverWrapper`.
        **settings: as for :class:`ObserverWrapper`.

    Raises:
        TypeError: as :class:`ObserverWrapper`.
        ValueError: as :class:`ObserverWrapper`; or a sequence of another length than there are slots.
    """

    def __init__(
        self,
        env: VectorEnv[Array, Array, Array],
        observer: str | Observer | Sequence[SlidingModeObserver] = "smo",
        compensation: bool | None = None,
        **settings: Any,
    ) -> None:
        task = task_of(env, batch=True)
        RecordConstructorArgs.__init__(self, **_named(observer, compensation, settings))
        VectorWrapper.__init__(self, env)
        n, plant = env.num_envs, (task.dt, _force(task), task.params)
        if isinstance(observer, Sequence) and not isinstance(observer, str):
            if settings or compensation is not None:
                raise ValueError("observers of a sequence have their own settings: give no others")
            if len(observer) != n or not all(isinstance(one, SlidingModeObserver) for one in observer):
                raise ValueError(
                    f"observer has {len(observer)} entries, it must have {n} SlidingModeObserver, one a slot"
                )
            self._estimator = cast(Any, SlidingModeObserver.start_each(observer, *plant))
        else:
            self._estimator = make_observer(observer, compensation, settings).start(n, *plant)
        self._mode = env.metadata["autoreset_mode"]
        self._over = np.zeros(n, dtype=np.bool_)
        self._none, self._every = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
        for shared in (self._none, self._every):
            shared.flags.writeable = False  # infos share them
        base = env.unwrapped
        self._show = base.show if isinstance(base, PendulumVectorEnv) else lambda xhat: None
        self.single_observation_space = _space(env.single_observation_space)
        self.observation_space = _space(env.observation_space)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start the episodes and their estimates."""
        observation, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        started = (options or {}).get("reset_mask", self._every)
        self._estimator.reset(started, info["state"].T)
        self._over[started] = False
        return self._append(observation, info, self._none), info

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Run a control period and bring the estimates to its end."""
        observation, reward, terminated, truncated, info = self.env.step(actions)
        ended = np.logical_or(terminated, truncated)
        same_step = self._mode is AutoresetMode.SAME_STEP
        restarted = ended if same_step else self._over
        any_restarted = np.count_nonzero(restarted) > 0
        last = _at_the_end(info) if same_step and any_restarted else info
        samples = np.ascontiguousarray(last["samples"].transpose(1, 2, 0))
        self._estimator.update(Period(self._y, samples, last["force"], np.ascontiguousarray(last["state"].T)))
        lost = _lost(self._estimator.xhat)
        if lost is not None:
            self._estimator.reset(lost, last["state"].T)
        failed: Flags = self._none if lost is None else lost
        if same_step and any_restarted:
            final_obs, xhat = info["final_obs"], self._estimator.xhat
            for i in np.flatnonzero(ended):
                final_obs[i] = np.concatenate([final_obs[i], xhat[:, i]])
            info["final_info"] |= {"estimate_failed": only(failed, ended), "_estimate_failed": ended.copy()}
        if any_restarted and self._mode is not AutoresetMode.DISABLED:
            self._estimator.reset(restarted, info["state"].T)
            failed = only(failed, ~restarted)
        self._over = ended
        return self._append(observation, info, failed), reward, terminated, truncated, info

    def _append(self, observation: Array, info: dict[str, Any], failed: Flags) -> Array:
        y, xhat = info["samples"][:, -1], self._estimator.xhat
        if np.count_nonzero(observation[:, :2] != y):
            raise _unseen(observation[:, :2], y)
        self._y = y.T.copy()
        info["estimate_failed"], info["_estimate_failed"] = failed, self._every
        self._show(xhat)
        appended = np.empty((len(observation), observation.shape[1] + 4))
        appended[:, :-4] = observation
        appended[:, -4:] = xhat.T
        return appended


def _at_the_end(info: dict[str, Any]) -> dict[str, Any]:
    """What slots that ended in this very step (SAME_STEP) gave last, beside what the others gave."""
    final = info["final_info"]
    merged = {}
    for key in ("samples", "force", "state"):
        merged[key] = info[key].copy()
        ended = final[f"_{key}"]
        merged[key][ended] = final[key][ended]
    return merged
