"""Learning on estimated state.

``observations.py`` says what an agent sees, ``sb3.py`` puts the vector environments into Stable-Baselines3,
``policy.py`` runs what was learned without it. Only ``sb3.py`` and ``training.py`` need the extra ``rl``.
"""

from pathlib import Path

from ..validation import choice
from .policy import MlpPolicy

BASELINES = {"SMOPendulum-v0": "pendulum", "SMOPendulumUpright-v0": "upright"}


def shipped(environment: str) -> MlpPolicy:
    """The policy on SMO estimates that comes with the package, as ``python agents/train.py`` trains it.

    Raises:
        ValueError: there is none for that environment.
    """
    name = BASELINES[choice("environment with a shipped policy", environment, BASELINES)]
    return MlpPolicy.load(Path(__file__).parent / "baselines" / f"{name}.safetensors")
