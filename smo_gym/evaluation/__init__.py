"""The harness: scenarios from ``configs/``, one rollout for every controller, metrics, statistics and tables."""

from .rollout import Rollout, rollout

__all__ = ["Rollout", "rollout"]
