"""What is random in a study, run by run: run r's draws depend on the seed and r alone, so more runs add to others."""

from __future__ import annotations

import numpy as np

from ..envs.task import KEYS
from ..typing import Array


def deviations(seed: int, runs: int) -> Array:
    """What multiplies the level of uncertainty in M_c, m and l, U(-1, 1), (runs, 3)."""
    return np.array([np.random.default_rng([seed, run]).uniform(-1.0, 1.0, 3) for run in range(runs)])


def noise(seed: int, runs: int) -> list[int]:
    """What noise, friction and disturbances of each run follow from, the reset option ``noise``."""
    return [int(np.random.default_rng([seed, run, 1]).integers(KEYS)) for run in range(runs)]
