"""What stands around an environment: the observer, and what an agent is to see."""

from .observer import ObserverWrapper
from .vector_observer import VectorObserverWrapper

__all__ = ["ObserverWrapper", "VectorObserverWrapper"]
