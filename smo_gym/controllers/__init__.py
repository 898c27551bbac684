"""Control laws: one a file, all with Stable-Baselines3's ``predict``."""

from .feedback import Feedback
from .lqr import LQR
from .protocol import Agent, title
from .sliding_mode import SlidingModeController

__all__ = ["LQR", "Agent", "Feedback", "SlidingModeController", "title"]
