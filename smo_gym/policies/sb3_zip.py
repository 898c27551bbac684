"""A model that Stable-Baselines3 saved, as an agent in newtons.

A zip says nothing of its environment. It is taken to be one of this package's as
:func:`~smo_gym.wrappers.view.agent_view` shows it, with the default force limit and control period.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from ..envs.task import HANGING
from ..typing import Array, Flags
from ..validation import observed
from ..wrappers.view import KINDS, scaled, units
from .memory import stacked

try:
    from stable_baselines3.common.save_util import load_from_zip_file
except ImportError as error:
    raise ImportError('a model of Stable-Baselines3 needs it: pip install "smo_gym[rl]"') from error


SIZES = {6: "smo", 2: "positions", 2 * KINDS["stacked"].frames: "stacked"}
"""Widths of an observation and the kind that has it; what stands in for the estimate does not show in the width."""


@dataclass(frozen=True)
class ZipPolicy:
    """u = force_limit a, with the deterministic action a in [-1, 1] of a Stable-Baselines3 policy.

    torch sums in an order that depends on the batch: the last bits of an action may differ between batches.
    """

    policy: Any
    frames: int
    units: Array
    """What each of one frame's entries is divided by, (entries,)."""
    force_limit: float = HANGING.force_limit
    control_period: float = HANGING.control_period

    def predict(
        self,
        observation: Array,
        state: tuple[Any, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Any, ...]]:
        """The force in N, (n, 1), for observations (n, observation); ``state`` is the frames and the policy's own.

        Raises:
            ValueError: the observation is of another environment.
        """
        size = len(self.units)
        observation = observed(observation)
        if observation.ndim != 2 or observation.shape[1] not in ((size,) if size == 6 else (size, size + 4)):
            raise ValueError(f"observation has shape {observation.shape}, the model sees {size} entries of each row")
        past, own = (None, None) if state is None else state
        frames = stacked(scaled(observation[:, :size], self.units), self.frames, past, episode_start)
        seen = frames.reshape(len(frames), -1).astype(np.float32)
        action, own = self.policy.predict(seen, own, episode_start, deterministic=True)
        return self.force_limit * np.asarray(action, dtype=np.float64), (frames, own)


def load(path: Path | str) -> ZipPolicy:
    """The policy of any algorithm of Stable-Baselines3 or sb3-contrib with continuous actions.

    Loading unpickles, which can run any code: only open files of those you trust.

    Raises:
        ValueError: the file is missing or corrupt, or the model is for other observations or actions.
    """
    if not Path(path).is_file():
        raise ValueError(f"{path}: is no file")
    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        seen, acts = data["observation_space"], data["action_space"]  # type: ignore[index]
        settings = {**({"use_sde": True} if data.get("use_sde") else {}), **data["policy_kwargs"]}  # type: ignore[union-attr, index]
        policy = data["policy_class"](seen, acts, lambda _: 0.0, **settings)  # type: ignore[index]
        policy.load_state_dict(parameters["policy"])
    except Exception as error:  # whatever a damaged zip and pickle may raise
        raise ValueError(f"{path}: cannot be read as a model of Stable-Baselines3 ({error})") from None
    if not isinstance(seen, spaces.Box) or seen.shape not in [(size,) for size in SIZES]:
        raise ValueError(f"{path}: observes {seen}, it must be a Box of width {' or '.join(map(str, SIZES))}")
    if not isinstance(acts, spaces.Box) or acts.shape != (1,) or (acts.low[0], acts.high[0]) != (-1.0, 1.0):
        raise ValueError(f"{path}: acts in {acts}, it must be Box(-1, 1, (1,))")
    frames = KINDS[SIZES[seen.shape[0]]].frames
    return ZipPolicy(policy, frames, units(seen.shape[0] // frames))
