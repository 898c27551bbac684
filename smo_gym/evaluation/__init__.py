"""The harness: scenarios from ``configs/``, one rollout for every controller, metrics, statistics and tables."""

from .rollout import Agent, Rollout, rollout

__all__ = ["Agent", "Rollout", "rollout"]
