"""Recordings of real rigs: how they are read, models of the rigs, references for the velocities, scores."""

from .cartpole import CART_POLE
from .indexed import fetch
from .loading import load
from .qube import QUBE
from .rig import Recording, Rig

RIGS = {rig.name: rig for rig in (CART_POLE, QUBE)}

__all__ = ["CART_POLE", "QUBE", "RIGS", "Recording", "Rig", "fetch", "load"]
