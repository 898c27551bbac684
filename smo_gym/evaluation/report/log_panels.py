"""Velocities that an observer makes of a log, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...recordings.logged import Log
from ...typing import Array
from .figures import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(log: Log, xhat: Array, names: Sequence[str]) -> Figure:
    """Positions on top, velocities below: the estimate, and what the backward difference makes of the same samples."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.8), layout="constrained")
        upper, lower = figure.subplots(2, 2, sharex=True)
        t = log.t - log.t[0]
        for c, name in enumerate(names):
            upper[c].plot(t, log.y[:, c], color="#8A8A8A", label="measured")
            upper[c].plot(t, xhat[:, c], color="#0072B2", label="estimate")
            upper[c].set_title(name)
            lower[c].plot(t[1:], np.diff(log.y[:, c]) / np.diff(t), color="#C9C9C9", label="backward difference")
            lower[c].plot(t, xhat[:, 2 + c], color="#0072B2", label="estimate")
            lower[c].set_title(f"{name}'")
            lower[c].set_xlabel("time, s")
        upper[0].legend(fontsize=7)
        lower[0].legend(fontsize=7)
    return figure
