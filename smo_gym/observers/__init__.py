"""Observers: one a file, all behind the :class:`~smo_gym.observers.protocol.Observer` protocol."""

from .estimator import start_each
from .gains import Gains
from .oracle import Oracle
from .protocol import Compiled, Estimator, Observer
from .sliding_mode import SlidingModeObserver

OBSERVERS = {"smo": SlidingModeObserver, "oracle": Oracle}

__all__ = ["OBSERVERS", "Compiled", "Estimator", "Gains", "Observer", "Oracle", "SlidingModeObserver", "start_each"]
