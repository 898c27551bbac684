"""The vector twin of :mod:`smo_gym.wrappers.observer`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from ..envs.vector import PendulumVectorEnv, only
from ..loop import Slots
from ..observers import Observer
from ..typing import Array, Flags
from .inside import Plugged, at_work, bring, lost_of, make_observer, named, space_of, task_of, unseen

_EVERY = slice(None)


class VectorObserverWrapper(VectorWrapper[Array, Array, Array, Array, Array], RecordConstructorArgs):
    """The vector twin of :class:`ObserverWrapper`, for the native vector environments and for Gymnasium's own.

    ``plugged`` says whether the observer works inside of the environment's compiled loop.

    All three autoreset modes work; in SAME_STEP ``info["final_obs"]`` carries the last estimate of the episode too.
    ``info["estimate_failed"]`` (n,) tells the slots whose estimate was lost in this step and started anew.

    Args:
        env: a vector environment of this package, or Gymnasium's vector environment of scalar ones.
        observer: as for :class:`ObserverWrapper`; or a sequence with one
            :class:`~smo_gym.observers.Observer` a slot, of any kinds, which puts arms of a comparison side by side in
            one batch.
        compensation: as for :class:`ObserverWrapper`.
        **settings: as for :class:`ObserverWrapper`.

    Raises:
        TypeError: the environment is not one of this package, or ``observer`` is not an observer.
        ValueError: an unknown observer or setting, settings beside an object, a step that the observer is not
            stable at, a wrapper inside that changes what the encoders measured, or a sequence of another length than
            there are slots.
    """

    def __init__(
        self,
        env: VectorEnv[Array, Array, Array],
        observer: str | Observer | Sequence[Observer] = "smo",
        compensation: bool | None = None,
        **settings: Any,
    ) -> None:
        task_of(env, batch=True)
        RecordConstructorArgs.__init__(self, **named(observer, compensation, settings))
        VectorWrapper.__init__(self, env)
        n = env.num_envs
        if isinstance(observer, Sequence) and not isinstance(observer, str):
            if settings or compensation is not None:
                raise ValueError("observers of a sequence have their own settings: give no others")
            if len(observer) != n or not all(hasattr(each, "start") for each in observer):
                raise ValueError(f"observer has {len(observer)} entries, it must have {n} observers, one a slot")
            observers = list(observer)
        else:
            observers = [make_observer(observer, compensation, settings)] * n
        self._estimator = at_work(env, observers)
        self._see = getattr(self._estimator, "see", None)
        self.plugged = isinstance(self._estimator, Plugged)
        self._mode = env.metadata["autoreset_mode"]
        self._over, self._any_over = np.zeros(n, dtype=np.bool_), False
        self._held = self._estimator.xhat
        self._none, self._every = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
        for shared in (self._none, self._every):
            shared.flags.writeable = False  # infos share them
        base = env.unwrapped
        self._show = base.show if isinstance(base, PendulumVectorEnv) else lambda xhat: None
        self.single_observation_space = space_of(env.single_observation_space)
        self.observation_space = space_of(env.observation_space)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start the episodes and their estimates."""
        started = (options or {}).get("reset_mask", self._every)  # before Gymnasium's own environments take it out
        observation, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        self._restart(started, observation, info)
        self._over[started] = False
        return self._append(observation, info, self._estimator.xhat, self._none, started), info

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Run a control period and bring the estimates to its end."""
        observation, reward, terminated, truncated, info = self.env.step(actions)
        ended = np.logical_or(terminated, truncated)
        any_ended = bool(np.count_nonzero(ended))
        same_step = self._mode is AutoresetMode.SAME_STEP
        restarted, any_restarted = (ended, any_ended) if same_step else (self._over, self._any_over)
        last = _at_the_end(info) if same_step and any_restarted else info
        if not self.plugged:
            told = last["forces"].T if "forces" in last else last["asked"]
            bring(self._estimator, np.ascontiguousarray(last["samples"].transpose(1, 2, 0)), told)
            if self._see is not None:
                self._see(self._every, last["state"].T)
        xhat = self._estimator.xhat
        if not self.plugged and self._any_over and self._mode is AutoresetMode.DISABLED:
            xhat[:, self._over] = self._held[:, self._over]  # an ended slot's estimate holds still, as inside of a loop
        self._held = xhat
        lost = lost_of(xhat)
        if lost is not None:
            self._restart(lost, last["samples"][:, -1], last)
            xhat = self._estimator.xhat
        failed: Flags = self._none if lost is None else lost
        if same_step and any_restarted:
            final_obs = info["final_obs"]
            for i in np.flatnonzero(ended):
                final_obs[i] = np.concatenate([final_obs[i], xhat[:, i]])
            info["final_info"] |= {"estimate_failed": only(failed, ended), "_estimate_failed": ended.copy()}
        if any_restarted and self._mode is not AutoresetMode.DISABLED:
            self._restart(restarted, observation, info)
            failed, xhat = only(failed, ~restarted), self._estimator.xhat
        self._over, self._any_over = ended, any_ended
        return self._append(observation, info, xhat, failed, _EVERY), reward, terminated, truncated, info

    def _restart(self, slots: Flags, observation: Array, info: dict[str, Any]) -> None:
        self._estimator.reset(slots, observation[:, :2].T)
        if self._see is not None:
            self._see(slots, info["state"].T)

    def _append(self, observation: Array, info: dict[str, Any], xhat: Array, failed: Flags, told: Slots) -> Array:
        seen, measured = observation[told, :2], info["samples"][told, -1]
        if np.count_nonzero(seen != measured):
            raise unseen(seen, measured)
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
    for key in {"samples", "asked", "forces", "state"} & info.keys():
        merged[key] = info[key].copy()
        ended = final[f"_{key}"]
        merged[key][ended] = final[key][ended]
    return merged
