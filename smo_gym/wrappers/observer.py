"""Append the estimate of the state to what the environment observes."""

from __future__ import annotations

import math
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from ..envs.pendulum import PendulumEnv
from ..observers import Observer
from ..typing import Array
from .inside import Plugged, at_work, bring, make_observer, named, space_of, task_of, unseen


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
        RecordConstructorArgs.__init__(self, **named(observer, compensation, settings))
        gymnasium.Wrapper.__init__(self, env)
        self.observer = make_observer(observer, compensation, settings)
        self._estimator = at_work(env, [self.observer])
        self._see = getattr(self._estimator, "see", None)
        self._plugged = isinstance(self._estimator, Plugged)
        # where nothing is told between measurement and estimate they stand together in the loop
        self._short = self._estimator if isinstance(self._estimator, Plugged) and task.reference is None else None
        self._every = np.ones(1, dtype=np.bool_)
        self._show = cast(PendulumEnv, env.unwrapped).show
        self._show(self._estimator.xhat[:, 0])
        self.observation_space = space_of(env.observation_space)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start the episode and the estimate."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._restart(observation, info)
        return self._append(observation, info, self._estimator.xhat[:, 0], False), info

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Run a control period and bring the estimate to its end."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if self._short:
            told: Array = self._short.observed[:, 0]
            values = told.tolist()
            if observation.tolist() != values[:2]:
                raise unseen(observation, told[:2])
            if math.isfinite(sum(values)):
                info["estimate_failed"] = False
                self._show(told[2:])
                return told, reward, terminated, truncated, info
        if not self._plugged:
            told = info["forces"][:, None] if "forces" in info else np.array([info["asked"]])
            bring(self._estimator, info["samples"][:, :, None], told)
            if self._see is not None:
                self._see(self._every, info["state"][:, None])
        xhat = self._estimator.xhat[:, 0]
        lost = not math.isfinite(sum(xhat.tolist())) and not np.isfinite(xhat).all()
        if lost:
            self._restart(observation, info)
            xhat = self._estimator.xhat[:, 0]
        return self._append(observation, info, xhat, lost), reward, terminated, truncated, info

    def _restart(self, observation: Array, info: dict[str, Any]) -> None:
        self._estimator.reset(self._every, observation[:2, None])
        if self._see is not None:
            self._see(self._every, info["state"][:, None])

    def _append(self, observation: Array, info: dict[str, Any], xhat: Array, lost: bool) -> Array:
        if (observation[:2] != info["samples"][-1]).any():
            raise unseen(observation[:2], info["samples"][-1])
        info["estimate_failed"] = lost
        self._show(xhat)
        told = np.empty(len(observation) + 4)
        told[:-4], told[-4:] = observation, xhat
        return told
