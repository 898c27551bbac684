"""Control laws: one a file, all with Stable-Baselines3's ``predict``."""

from .lqr import LQR
from .protocol import Agent, title
from .sliding_mode import SlidingModeController

__all__ = ["LQR", "Agent", "SlidingModeController", "title"]
