"""Control laws: one a file, all with Stable-Baselines3's ``predict``."""

from .feedback import Feedback
from .integral_sliding_mode import IntegralSlidingMode
from .linear import Linear
from .lqr import LQR
from .model_predictive import ModelPredictive
from .protocol import Agent, title
from .reaching import Condition, Reaching
from .sliding_mode import SlidingModeController
from .surface import SurfaceControl, surface

__all__ = [
    "LQR",
    "Agent",
    "Condition",
    "Feedback",
    "IntegralSlidingMode",
    "Linear",
    "ModelPredictive",
    "Reaching",
    "SlidingModeController",
    "SurfaceControl",
    "surface",
    "title",
]
