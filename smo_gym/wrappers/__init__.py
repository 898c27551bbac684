"""What stands around an environment: the observer, and what an agent is to see."""

from .observer import ObserverWrapper, VectorObserverWrapper

__all__ = ["ObserverWrapper", "VectorObserverWrapper"]
