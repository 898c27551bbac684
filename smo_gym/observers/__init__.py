"""Observers: one a file, all behind the :class:`~smo_gym.observers.protocol.Observer` protocol."""

from .constant_acceleration import ConstantAcceleration
from .difference import BackwardDifference, FilteredDerivative
from .estimator import start_each
from .gains import Gains
from .high_gain import HighGain
from .homogeneous import Homogeneous
from .kalman import ExtendedKalmanFilter
from .luenberger import Luenberger, SteadyKalman
from .moving_horizon import MovingHorizon
from .oracle import Oracle
from .protocol import Compiled, Estimator, Observer
from .sliding_mode import SlidingModeObserver
from .super_twisting import Levant, SuperTwisting
from .unscented import UnscentedKalmanFilter

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
    "ukf": UnscentedKalmanFilter,
    "mhe": MovingHorizon,
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
    "MovingHorizon",
    "Observer",
    "Oracle",
    "SlidingModeObserver",
    "SteadyKalman",
    "SuperTwisting",
    "UnscentedKalmanFilter",
    "start_each",
]
