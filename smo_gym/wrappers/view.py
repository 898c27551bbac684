"""What a learning agent sees and gives: five kinds of observation in fixed units, actions in [-1, 1].

Inside out: the environment in SI units, an observer or none, then the unit scaling of this file. The observer so sees
newtons, and an agent sees numbers of order one in float32. No running statistics: a policy stays what it was
trained as, on one plant as on a thousand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import FlattenObservation, FrameStackObservation
from numpy.typing import NDArray

from ..typing import Array
from ..validation import choice
from .inside import task_of
from .observer import ObserverWrapper
from .vector_observer import VectorObserverWrapper

Single = NDArray[np.float32]

UNITS = (1.0, 1.0, 2.0, 4.0)
"""What a policy's inputs h, theta, h', theta' are divided by, m, rad, m/s, rad/s. Chosen: regulation from Table 4's
start stays within 2 to 3 of them. A reference's and an estimate's parts have the same."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of observation.

    Args:
        observer: settings of :class:`~smo_gym.ObserverWrapper`; None for no observer.
        frames: how many observations, the newest last, are told together; at a start the first is repeated.
    """

    observer: Mapping[str, Any] | None = None
    frames: int = 1


LIMIT = 10.0
"""Where scaled observations are clipped (chosen)."""

# The slopes are those that the article's LQR tables identify (configs/article.yaml), the gains Table 3's.
_SMO = {"observer": "smo", "gains": "lqr", "slopes": (12.5, 12.5)}

KINDS: dict[str, Kind] = {
    "smo": Kind({**_SMO, "compensation": True}),
    "smo-uncompensated": Kind({**_SMO, "compensation": False}),
    "state": Kind({"observer": "oracle"}),
    "positions": Kind(),
    "stacked": Kind(frames=4),
}
"""Estimates with and without compensation of the input uncertainty; the true state in their place; [h, theta] alone;
the last four of them (chosen: 80 ms at the default control period)."""


def units(size: int) -> Array:
    """The units of an observation [h, theta, then a state (4) any number of times], (size,)."""
    return np.array([*UNITS[:2], *UNITS * ((size - 2) // 4)])


def scaled(observation: Array, units: Array) -> Array:
    """The observation in its units, finite and bounded."""
    return np.fmax(np.fmin(observation / units, LIMIT), -LIMIT)  # unlike clip they leave no NaN


def agent_view(env: gymnasium.Env[Array, Array], observation: str = "smo") -> gymnasium.Env[Any, Any]:
    """A scalar environment of this package as a learning agent meets it.

    The observation is in :data:`UNITS`, float32, its frames flattened oldest first; the action is in [-1, 1].

    Args:
        env: the environment, in SI units.
        observation: one of :data:`KINDS`.

    Raises:
        TypeError: the environment is not one of this package.
        ValueError: an unknown kind, an environment without a force limit, or one that has an observer already or
            whose observation is otherwise changed.
    """
    kind = KINDS[choice("observation", observation, KINDS)]
    task_of(env, batch=False)
    view: gymnasium.Env[Any, Any] = ScaleWrapper(ObserverWrapper(env, **kind.observer) if kind.observer else env)
    if kind.frames == 1:
        return view
    return FlattenObservation(FrameStackObservation(view, kind.frames, padding_type="reset"))


class ScaleWrapper(gymnasium.Wrapper[Any, Any, Array, Array], RecordConstructorArgs):
    """Observations in their units, in float32; actions in [-1, 1], which stand for the whole range of the force.

    Raises:
        ValueError: an environment without a force limit.
    """

    def __init__(self, env: gymnasium.Env[Array, Array]) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        self._force = _bounded(env.action_space)
        self._units = units(env.observation_space.shape[0])  # type: ignore[index]
        self.observation_space = _observations(len(self._units))
        self.action_space = _actions()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Single, dict[str, Any]]:
        """Start the episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._told(observation), info

    def step(self, action: Single) -> tuple[Single, Any, bool, bool, dict[str, Any]]:
        """Apply an action in [-1, 1]."""
        force = self._force * np.asarray(action, dtype=np.float64)
        observation, reward, terminated, truncated, info = self.env.step(force)
        return self._told(observation), reward, terminated, truncated, info

    def _told(self, observation: Array) -> Single:
        return scaled(observation, self._units).astype(np.float32)


class VectorAgentView(VectorWrapper[Single, Array, Array, Array, Array]):
    """The vector twin of :func:`agent_view`, in all three autoreset modes.

    Raises:
        TypeError: the environment is not one of this package.
        ValueError: an unknown kind, an environment without a force limit, or one that has an observer already or
            whose observation is otherwise changed.
    """

    def __init__(self, env: VectorEnv[Array, Array, Array], observation: str = "smo") -> None:
        self.kind = KINDS[choice("observation", observation, KINDS)]
        task_of(env, batch=True)
        self._force = _bounded(env.single_action_space)
        super().__init__(VectorObserverWrapper(env, **self.kind.observer) if self.kind.observer else env)
        self._units = units(self.env.single_observation_space.shape[0])  # type: ignore[index]
        self._mode = env.metadata["autoreset_mode"]
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._frames = np.zeros((self.num_envs, self.kind.frames, len(self._units)), dtype=np.float32)
        self.single_observation_space = _observations(self.kind.frames * len(self._units))
        self.single_action_space = _actions()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Single, dict[str, Any]]:
        """Start the episodes."""
        started = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        observation, info = self.env.reset(seed=seed, options=options)
        self._frames[started] = scaled(observation, self._units)[started, None]
        self._over[started] = False
        return self._told(), info

    def step(self, actions: Array) -> tuple[Single, Array, Any, Any, dict[str, Any]]:
        """Apply actions in [-1, 1], which stand for the whole range of the force."""
        observation, reward, terminated, truncated, info = self.env.step(
            self._force * np.asarray(actions, dtype=np.float64)
        )
        ended = np.logical_or(terminated, truncated)
        same_step = self._mode is AutoresetMode.SAME_STEP
        restarted = ended if same_step else self._over
        self._frames[:, :-1] = self._frames[:, 1:]
        newest = scaled(observation, self._units)
        if np.count_nonzero(restarted) and self._mode is not AutoresetMode.DISABLED:
            if same_step:
                final_obs = info["final_obs"]
                for i in np.flatnonzero(ended):
                    last = scaled(final_obs[i], self._units).astype(np.float32)
                    final_obs[i] = np.concatenate([*self._frames[i, :-1], last])
            self._frames[restarted] = newest[restarted, None]
        self._frames[:, -1] = newest
        self._over = ended
        return self._told(), reward, terminated, truncated, info

    def _told(self) -> Single:
        return self._frames.reshape(self.num_envs, -1).copy()


def _bounded(space: Any) -> float:
    limit = float(cast(spaces.Box, space).high[0])
    if not np.isfinite(limit):
        raise ValueError("force_limit=None: a learning agent's actions in [-1, 1] need a finite force limit")
    return limit


def _observations(size: int) -> spaces.Box:
    return spaces.Box(np.float32(-LIMIT), np.float32(LIMIT), (size,), np.float32)


def _actions() -> spaces.Box:
    return spaces.Box(np.float32(-1.0), np.float32(1.0), (1,), np.float32)
