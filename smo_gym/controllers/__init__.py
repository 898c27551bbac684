"""Control laws: one a file, all with Stable-Baselines3's ``predict``."""

from .lqr import LQR
from .sliding_mode import SlidingModeController

__all__ = ["LQR", "SlidingModeController"]
