"""Settings of training runs in rl-baselines3-zoo's shape, and what is made of them: environment and algorithm."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode, VectorEnv

from .. import files
from ..envs.task import plain_data
from ..validation import choice, mapping, number, whole
from ..wrappers.view import KINDS, VectorAgentView
from .measurement import TRAINING, seeds
from .sb3 import SB3VecEnv

try:
    from sb3_contrib import RecurrentPPO
    from stable_baselines3 import PPO
    from stable_baselines3.common.utils import LinearSchedule
except ImportError as error:
    raise ImportError('training needs Stable-Baselines3 and sb3-contrib: pip install "smo_gym[rl]"') from error

ALGORITHMS: dict[str, type[Any]] = {"ppo": PPO, "recurrent": RecurrentPPO}
VIEW = "smo_gym.wrappers.view.agent_view"
OURS = {"self", "env", "seed", "device", "tensorboard_log", "_init_setup_model"}
"""Arguments of an algorithm that are no hyperparameters."""
WHOLE = ("n_steps", "batch_size", "n_epochs")
SCHEDULES = ("learning_rate", "clip_range", "clip_range_vf")
AT_MOST = {"gamma": 1.0, "gae_lambda": 1.0} | dict.fromkeys(
    (*SCHEDULES, "ent_coef", "vf_coef", "max_grad_norm", "target_kl"), math.inf
)
"""Hyperparameters that are numbers from 0 to this; the algorithms take any, and learn nothing from a wrong one."""
OFF = ("clip_range_vf", "target_kl")
"""Hyperparameters that may be null."""


@dataclass(frozen=True)
class Run:
    """All that a trained policy depends on."""

    environment: str
    observation: str
    algorithm: str
    seed: int
    steps: int
    n_envs: int
    options: dict[str, Any]
    """Options of the environment."""
    hyperparameters: dict[str, Any]
    """Hyperparameters of the algorithm."""
    continues: tuple[int, ...] = ()
    """The steps of finished runs that this one goes on from, each of the one before."""

    def plain(self) -> dict[str, Any]:
        """The run as JSON has it; without ``continues`` where it begins anew."""
        found = dict(plain_data(self))
        return found if self.continues else {name: found[name] for name in found if name != "continues"}

    def checked(self) -> Run:
        """The run itself, when an environment and an algorithm can be made of it.

        Raises:
            ValueError: a name or value that is not allowed.
        """
        choice("observation", self.observation, KINDS)
        if self.algorithm == "recurrent" and self.observation != "positions":
            raise ValueError(f"observation={self.observation!r}: the recurrent algorithm is for 'positions' alone")
        given = mapping(
            "hyperparameter",
            self.hyperparameters,
            set(inspect.signature(ALGORITHMS[self.algorithm].__init__).parameters) - OURS,
        )
        counts = {"n_envs": self.n_envs, "n_timesteps": self.steps, "n_steps": given.get("n_steps")}
        for name, value in (counts | {name: given[name] for name in WHOLE if name in given}).items():
            whole(name, value, 1)
        whole("seed", self.seed, 0)
        if not isinstance(given.get("policy_kwargs", {}), dict):
            raise ValueError(f"policy_kwargs={given['policy_kwargs']!r} must be a mapping, such as {{net_arch: [64]}}")
        built(self)
        env = SB3VecEnv(make(self, self.n_envs, AutoresetMode.SAME_STEP))
        with warnings.catch_warnings(action="ignore"):  # training makes another, and warns then
            learner(self, env)
        env.close()
        return self


def load(
    path: Path,
    environment: str,
    algorithm: str,
    observation: str | None = None,
    seed: int = 0,
    steps: int | None = None,
    uncertainty: float | None = None,
    others: Mapping[str, Any] | None = None,
) -> Run:
    """A run from a file of hyperparameters in rl-baselines3-zoo's shape; what is given here takes their place.

    ``others`` are more options of the environment.

    Raises:
        ValueError: the file cannot be read, or an unknown, missing or bad value.
    """
    data = files.read_yaml(path)
    try:
        if not isinstance(data, dict):
            raise ValueError("must be a mapping of environments to hyperparameters")
        entry = data[choice("environment", environment, data)]
        given = dict(entry) if isinstance(entry, dict) else {}
        if missing := {"n_envs", "n_timesteps", "policy", "env_wrapper"} - given.keys():
            raise ValueError(f"{environment} lacks {', '.join(sorted(missing))}")
        kind = _seen(given.pop("env_wrapper"))
        options = given.pop("env_kwargs", {})
        if not isinstance(options, dict):
            raise ValueError(f"{environment}: env_kwargs={options!r} must be a mapping of the environment's options")
        options = options | ({} if uncertainty is None else {"uncertainty": uncertainty}) | {**(others or {})}
        for name in ("n_envs", "n_timesteps", *WHOLE):
            if isinstance(given.get(name), float) and given[name].is_integer():  # YAML says 1e6, the zoo !!float 1e6
                given[name] = int(given[name])
        n_envs, n_timesteps = given.pop("n_envs"), given.pop("n_timesteps")
        length = n_timesteps if steps is None else steps
        return Run(environment, observation or kind, algorithm, seed, length, n_envs, options, given).checked()
    except (ValueError, TypeError, gymnasium.error.Error) as error:
        raise ValueError(f"{path}: {error}") from None


def _seen(wrapper: Any) -> str:
    """The kind of observation that ``env_wrapper`` asks for."""
    view = wrapper[0] if isinstance(wrapper, list) and len(wrapper) == 1 else None
    if not isinstance(view, dict) or list(view) != [VIEW]:
        raise ValueError(f"env_wrapper={wrapper!r} must be a list of {VIEW} with its arguments alone")
    arguments = mapping("argument of agent_view", view[VIEW], {"observation"})
    return choice("observation", arguments.get("observation", "smo"), KINDS)


def make(run: Run, n: int, mode: AutoresetMode, **others: Any) -> VectorEnv[Any, Any, Any]:
    """The run's environment as an agent sees it."""
    env = gymnasium.make_vec(run.environment, n, autoreset_mode=mode, **{**run.options, **others})
    return VectorAgentView(env, run.observation)


def learner(run: Run, env: Any, log: str | None = None) -> Any:
    """The run's algorithm before it has learned, on an environment as Stable-Baselines3 has it.

    Raises:
        ValueError: hyperparameters that nothing can be made of.
    """
    seed, settings = seeds(TRAINING, 1, run.seed)[0], built(run)
    try:
        return ALGORITHMS[run.algorithm](env=env, seed=seed, device="cpu", tensorboard_log=log, **settings)
    except Exception as error:  # whatever the library raises for a value that it does not know
        raise ValueError(f"hyperparameters: {type(error).__name__}: {error}") from error


def built(run: Run) -> dict[str, Any]:
    """Hyperparameters with the zoo's schedules: lin_1e-3 falls from 1e-3 to 0.

    Raises:
        ValueError: one that should be a number is none, or out of its range.
    """
    found = dict(run.hyperparameters)
    for name, most in AT_MOST.items():
        value = found.get(name)
        if name not in found or (value is None and name in OFF):
            continue
        falls = name in SCHEDULES and str(value).startswith("lin_")
        try:
            start = number(name, float(str(value).removeprefix("lin_")) if falls else value)
        except ValueError:
            start = math.nan
        if not 0.0 <= start <= most:
            allowed = "of at least 0" if math.isinf(most) else f"from 0 to {most:g}"
            lin = ", or lin_ and such a number" if name in SCHEDULES else ""
            raise ValueError(f"{name}={value!r} must be a number {allowed}{lin}")
        if falls:
            found[name] = LinearSchedule(start, 0.0, 1.0)
    return found
