"""Training runs: checkpoints to resume from, evaluation on unseen plants, and the policy as it is kept."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from .. import files
from ..policies.frozen import Card, LstmPolicy, MlpPolicy
from ..validation import whole
from ..wrappers.view import KINDS, units
from .measurement import TRAINING, VALIDATION, measure, seeds
from .resuming import agree, continued, keep, see_best
from .sb3 import SB3VecEnv, layers, lstm_weights
from .settings import Run, learner, make

try:
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecMonitor
except ImportError as error:
    raise ImportError('training needs Stable-Baselines3 and sb3-contrib: pip install "smo_gym[rl]"') from error

CHECKPOINTS = 20
BEST = "best.safetensors"


def frozen(model: Any, run: Run) -> MlpPolicy:
    """The policy that a model would act by, without exploration.

    Raises:
        ValueError: its network is not dense with tanh, nor that behind one LSTM layer, or its output is squashed.
    """
    actor = model.policy
    weights, lstm = layers(actor), getattr(actor, "lstm_actor", None)
    env = make(run, 1, AutoresetMode.SAME_STEP)
    force_limit = env.unwrapped.task.force_limit  # type: ignore[attr-defined]
    frames = KINDS[run.observation].frames
    inputs = env.single_observation_space.shape[0]  # type: ignore[index]
    card = Card(
        environment=run.environment,
        observation=run.observation,
        units=tuple(units(inputs // frames).tolist()),
        frames=frames,
        layers=(*(W.shape[1] for W, _ in weights), 1),
        lstm=lstm.hidden_size if lstm else None,
        force_limit=force_limit,
        seed=int(run.seed),
        configuration=run.plain(),
    )
    return LstmPolicy(card, weights, lstm_weights(lstm)) if lstm else MlpPolicy(card, weights)


class Watch(BaseCallback):
    """Every twentieth of a run: evaluate, keep the best policy and a checkpoint, begin afresh with seeds of that place.

    So what follows a checkpoint depends on the checkpoint alone: an interrupted run ends where an uninterrupted one
    does, on the same machine and number of threads.
    """

    def __init__(self, run: Run, checkpoint: Path, progress: Callable[[int, dict[str, float]], object]) -> None:
        super().__init__()
        self._run, self._checkpoint, self._progress = run, checkpoint, progress
        rollout_steps = run.n_envs * int(run.hyperparameters["n_steps"])
        self._every = rollout_steps * max(1, round(run.steps / rollout_steps / CHECKPOINTS))
        self._fresh = True

    def _on_rollout_start(self) -> None:
        if self._fresh or self.num_timesteps % self._every == 0:
            if not self._fresh:
                self.keep()
            self._restart()
        self._fresh = False

    def keep(self) -> None:
        """Evaluate, write the policy if none was better before, and a checkpoint."""
        policy = frozen(self.model, self._run)
        found = measure(policy, VALIDATION)
        before = curve(self.model)
        if not before or cost(found) < min(cost(point) for point in before):
            policy.save(self._checkpoint.with_name(BEST))
        self.model.curve = [*before, {"steps": self.num_timesteps, **found}]  # type: ignore[attr-defined]
        for name, value in found.items():
            self.logger.record(f"validation/{name}", value)
        files.write_bytes(self._checkpoint, state_bytes(self.model))
        self._progress(self.num_timesteps, found)

    def _restart(self) -> None:
        seed, n = seeds(TRAINING, 1, self._run.seed, self.num_timesteps)[0], self._run.n_envs
        self.model.set_random_seed(seed)
        # the first episodes end at random times: else all slots would go through their episodes in step, and every
        # update would see one phase of them alone
        most = self.training_env.get_attr("task", 0)[0].steps
        self.training_env.set_options({"steps": np.random.default_rng(seed).integers(1, most, n, endpoint=True)})
        model: Any = self.model
        if model.use_sde:
            model.policy.reset_noise(n)  # that of this rollout was drawn before the seed was set
        self.model._last_obs = self.training_env.reset()  # type: ignore[assignment]
        self.model._last_episode_starts = np.ones(n, dtype=np.bool_)

    def _on_step(self) -> bool:
        return True


def state_bytes(model: Any) -> bytes:
    """What a model has learned so far, as tensors and numbers: all that :func:`restore` needs beside the run."""
    policy = model.policy
    found = {
        "policy": policy.state_dict(),
        "optimizer": policy.optimizer.state_dict()["state"],
        "n_updates": model._n_updates,
        "curve": curve(model),
    }
    file = io.BytesIO()
    torch.save(found, file)
    return file.getvalue()


def restore(model: Any, path: Path) -> None:
    """Bring a model that has not learned to a checkpoint; tensors and numbers are read, no code is run.

    Raises:
        ValueError: the file cannot be read, or is of a model of another form.
    """
    policy = model.policy
    optimizer = policy.optimizer
    try:
        with warnings.catch_warnings(action="ignore"):  # of pickles, which are then refused
            found = torch.load(path, map_location="cpu", weights_only=True)
        policy.load_state_dict(found["policy"])
        optimizer.load_state_dict({**optimizer.state_dict(), "state": found["optimizer"]})
        for parameter, moments in optimizer.state.items():
            parts = [parameter, *(moment for moment in moments.values() if moment.ndim)]
            if not all(part.shape == parameter.shape and part.isfinite().all() for part in parts):
                raise ValueError("a tensor is not finite or of another shape")
        points = found["curve"]
        if not (points and optimizer.state) or any({"steps", "runs", "failed"} - point.keys() for point in points):
            raise ValueError("something is missing")
        if not all(math.isfinite(value) for point in points for value in point.values()):
            raise ValueError("an evaluation is not finite")
        model.curve, model.num_timesteps = points, whole("steps", points[-1]["steps"], 1)
        model._n_updates = whole("n_updates", found["n_updates"], 1)
    except UnpicklingError:
        raise _damaged(path, "it holds something else than tensors and numbers, which could run any code") from None
    except Exception as error:  # whatever a damaged file may raise
        raise _damaged(path, files.shortened(str(error)) or type(error).__name__) from None


def _damaged(path: Path, reason: str) -> ValueError:
    return ValueError(f"{path}: cannot be read ({reason}): remove it to begin anew")


def curve(model: Any) -> list[dict[str, float]]:
    """What the evaluations of a model during its training gave."""
    return list(getattr(model, "curve", []))


def cost(found: dict[str, float]) -> tuple[float, float]:
    """What a policy is chosen by: failures first, then MSE of h + MSE of theta."""
    return found["failed"], found.get("mse_h", math.inf) + found.get("mse_theta", math.inf)


def train(
    run: Run,
    folder: Path,
    progress: Callable[[int, dict[str, float]], object] = lambda steps, found: None,
    tensorboard: bool = False,
) -> MlpPolicy:
    """Train, or go on from the checkpoint in ``folder``.

    A run that is longer than a finished one there, and alike in all else, goes on from it: schedules are those of the
    longer run from there on, so what comes out is not what the longer run would have learned in one go.

    Args:
        run: what to train.
        folder: of the checkpoint, which holds a run of exactly these settings or none.
        progress: called at every checkpoint with the steps done and what the policy was then.
        tensorboard: write what TensorBoard shows, too.

    Returns:
        Of the policies at the checkpoints the one that did best on validation plants, with the curve and its result on
        test plants on its card.

    Raises:
        ValueError: hyperparameters that nothing can be made of, or a network that cannot be frozen; the folder holds
            a run of other settings, an unfinished shorter one, or a checkpoint that cannot be read or stands alone.
    """
    checkpoint, settings = folder / "checkpoint.pt", folder / "run.json"
    env = VecMonitor(SB3VecEnv(make(run, run.n_envs, AutoresetMode.SAME_STEP)))
    log = str(folder / "tensorboard") if tensorboard else None
    begun = checkpoint.exists()
    if not begun:
        files.refuse_pickle(folder / "checkpoint.zip")
    model = learner(run, env, log)
    frozen(model, run)  # what cannot be frozen is noticed now, not at the first checkpoint
    there, run = continued(settings, run) if begun else (run.plain(), run)
    agree(settings, there, begun)
    if begun:
        restore(model, checkpoint)
        see_best(folder / BEST, run)
        if there["steps"] < run.steps:
            if model.num_timesteps < there["steps"]:
                raise ValueError(
                    f"steps={run.steps}: {folder} holds an unfinished run of {there['steps']} steps: finish it "
                    "first, or choose another --out"
                )
            keep(settings, run.plain())
    watch = Watch(run, checkpoint, progress)
    progress(model.num_timesteps, {})
    if model.num_timesteps < run.steps:
        model.learn(run.steps - model.num_timesteps, callback=watch, reset_num_timesteps=False, tb_log_name="run")
        watch.keep()
    policy = MlpPolicy.load(folder / BEST)
    card = policy.card.model_copy(
        update={"configuration": run.plain(), "curve": curve(model), "measured": measure(policy)}
    )
    return replace(policy, card=card)
