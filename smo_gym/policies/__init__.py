"""Policies that were learned, run without what they were learned with, and agents by name.

``frozen.py`` runs weights from ``.safetensors``, ``sb3_zip.py`` a model of Stable-Baselines3, which alone needs the
extra ``rl``; ``named.py`` finds an agent by what it is called on the command line.
"""

from .frozen import MlpPolicy
from .named import BASELINES, shipped

__all__ = ["BASELINES", "MlpPolicy", "shipped"]
