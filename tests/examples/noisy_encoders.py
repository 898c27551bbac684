"""Encoders with noise: a wrapper inside of the observer, which changes samples and observation alike."""

import gymnasium
import numpy as np
from gymnasium.vector import VectorWrapper

from smo_gym.envs.vector import PendulumVectorEnv


class NoisyEncoders(VectorWrapper):
    """White noise of ``sigma`` in m and rad, the same in every run of the program."""

    def __init__(self, env, sigma):
        super().__init__(env)
        self.sigma, self._rng = sigma, np.random.default_rng(0)

    def reset(self, *, seed=None, options=None):
        self._rng = np.random.default_rng(0)
        return self._measured(*super().reset(seed=seed, options=options))

    def step(self, actions):
        observation, *rest, info = super().step(actions)
        observation, info = self._measured(observation, info)
        return observation, *rest, info

    def _measured(self, observation, info):
        samples = info["positions"] + self.sigma * self._rng.standard_normal(info["positions"].shape)
        observation[:, :2] = samples[:, -1]
        return observation, info | {"samples": samples}


def make(num_envs, sigma=1e-3, **options):
    return NoisyEncoders(PendulumVectorEnv(num_envs, **options), sigma)


gymnasium.register("Noisy-v0", vector_entry_point=make)
