"""Observers: one a file, all behind the :class:`~smo_gym.observers.protocol.Observer` protocol."""

from .oracle import Oracle
from .protocol import Estimator, Observer, Period
from .sliding_mode import Gains, SlidingModeObserver

OBSERVERS = {"smo": SlidingModeObserver, "oracle": Oracle}

__all__ = ["OBSERVERS", "Estimator", "Gains", "Observer", "Oracle", "Period", "SlidingModeObserver"]
