"""Observers: one a file, all behind the :class:`~smo_gym.observers.protocol.Observer` protocol."""

from .constant_acceleration import ConstantAcceleration
from .difference import BackwardDifference, FilteredDerivative
from .estimator import start_each
from .gains import Gains
from .high_gain import HighGain
from .homogeneous import Homogeneous
from .kalman import ExtendedKalmanFilter
from .luenberger import Luenberger, SteadyKalman
from .oracle import Oracle
from .protocol import Compiled, Estimator, Observer
from .sliding_mode import SlidingModeObserver
from .super_twisting import Levant, SuperTwisting

OBSERVERS = {
    "smo": SlidingModeObserver,
    "backward-difference": BackwardDifference,
    "filtered-derivative": FilteredDerivative,
    "high-gain": HighGain,
    "levant": Levant,
    "super-twisting": SuperTwisting,
    "homogeneous": Homogeneous,
    "luenberger": Luenberger,
    "steady-kalman": SteadyKalman,
    "kalman-ca": ConstantAcceleration,
    "ekf": ExtendedKalmanFilter,
    "oracle": Oracle,
}

__all__ = [
    "OBSERVERS",
    "BackwardDifference",
    "Compiled",
    "ConstantAcceleration",
    "Estimator",
    "ExtendedKalmanFilter",
    "FilteredDerivative",
    "Gains",
    "HighGain",
    "Homogeneous",
    "Levant",
    "Luenberger",
    "Observer",
    "Oracle",
    "SlidingModeObserver",
    "SteadyKalman",
    "SuperTwisting",
    "start_each",
]
