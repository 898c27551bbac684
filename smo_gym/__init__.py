"""Sliding mode estimation and control of an uncertain cart pendulum, seen only through its position encoders.

Importing registers three environments, each scalar and natively vectorised:

- ``SMOPendulum-v0``: the article's plant (g = -9.8 m/s^2: theta = 0 hangs).
- ``SMOPendulumUpright-v0``: g = +9.8 m/s^2, theta = 0 is upright.
- ``SMOPendulumTracking-v0``: the article's plant and a minimum-energy reference to follow.
"""

from .cli import starting

if starting.is_command():  # before the imports below, which take seconds
    starting.begin()

import gymnasium

from .controllers import LQR, SlidingModeController
from .kernels.batch import set_threads
from .observers import Gains, Oracle, SlidingModeObserver
from .plant import CartPendulum
from .reference import Reference
from .wrappers import ObserverWrapper, VectorObserverWrapper

__version__ = "0.8.0"

__all__ = [
    "LQR",
    "CartPendulum",
    "Gains",
    "ObserverWrapper",
    "Oracle",
    "Reference",
    "SlidingModeController",
    "SlidingModeObserver",
    "VectorObserverWrapper",
    "set_threads",
]

_IDS = {"SMOPendulum-v0": "Pendulum", "SMOPendulumUpright-v0": "Upright", "SMOPendulumTracking-v0": "Tracking"}

for _id, _name in _IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point=f"smo_gym.envs.pendulum:{_name}Env",
            vector_entry_point=f"smo_gym.envs.vector:{_name}VectorEnv",
        )
