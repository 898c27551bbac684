"""Throughput of PPO's ``learn()`` on the native vector environment, beside the same PPO on one that costs nothing.

python benchmarks/learning.py --threads 2
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv
from tabulate import tabulate

import smo_gym
from smo_gym.learning.sb3 import SB3VecEnv
from smo_gym.wrappers.view import VectorAgentView


class Costless(SB3VecEnv):
    """Steps by handing out the same arrays again."""

    def reset(self):
        """The last observation that costs anything."""
        self._told = super().reset()
        self._step = np.zeros(self.num_envs, np.float32), np.zeros(self.num_envs, np.bool_)
        self._infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._told

    def step_wait(self):
        """The same again."""
        return self._told, *self._step, self._infos


def make(kind: type[SB3VecEnv], slots: int) -> VecEnv:
    env = gymnasium.make_vec("SMOPendulum-v0", slots, autoreset_mode="SameStep", horizon=8.0)
    return kind(VectorAgentView(env, "smo"))


def frames_a_second(model: PPO, frames: int) -> float:
    began = time.perf_counter()
    model.learn(frames)
    return frames / (time.perf_counter() - began)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--slots", type=int, default=256)
    parser.add_argument("--repeats", type=int, default=9)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    smo_gym.set_threads(args.threads)
    settings = {"n_steps": 64, "batch_size": 4096, "n_epochs": 4, "seed": 0, "device": "cpu"}
    models = [PPO("MlpPolicy", make(kind, args.slots), **settings) for kind in (Costless, SB3VecEnv)]
    frames = 4 * settings["n_steps"] * args.slots
    for model in models:
        model.learn(frames)  # compiles
    speeds = [[frames_a_second(model, frames) for model in models] for _ in range(args.repeats)]  # alternating
    costless, ours = (statistics.median(column) for column in zip(*speeds, strict=True))
    ratio = statistics.median(b / a for a, b in speeds)
    print(tabulate([["costless", costless], ["native vector environment with observer", ours]], floatfmt=",.0f"))
    print(f"ratio {ratio:.3f} (median of {args.repeats} alternating pairs), {args.threads} threads")


if __name__ == "__main__":
    main()
