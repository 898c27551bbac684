"""One passage of a sensor's fault, as some observers live through it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...recordings import scoring, smoothing
from ..candidates import Candidate
from ..on_recordings import Runs
from .figures import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = {
    "backward-difference": "#8F8F8F",
    "kalman-ca": "#D55E00",
    "ekf": "#B35C92",
    "smo": "#0072B2",
    "ekf-adaptive": "#009E73",
}
"""Observers of the picture, those of them that there are, and their colours."""
BEFORE, AFTER = 12, 25
"""Samples that are shown before and after."""


def draw(runs: Runs, observers: Mapping[str, Candidate]) -> Figure:
    """The angle, and the error of its speed against the smoother that skips the fault, around one passage."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    places = [(k, place) for k, each in enumerate(runs.recordings) for place in scoring.passages(each)]
    k, place = places[len(places) // 2]
    recording, truth = runs.recordings[k], runs.references[smoothing.MODEL][k][:, 1]
    window = slice(max(place.start - BEFORE, 0), place.stop + AFTER)
    t = (recording.t - recording.t[place.start])[window]
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.6), layout="constrained")
        angle, speed = figure.subplots(1, 2)
        angle.plot(t, recording.y[window, 1], "o", color="#0072B2", markersize=3, label="measured")
        silent = recording.fault[window]
        angle.plot(
            t[silent], recording.y[window, 1][silent], "o", color="#D55E00", markersize=4, label="not to be believed"
        )
        angle.set(title="angle, rad", xlabel="time, s")
        angle.legend(fontsize=7)
        for name, colour in SHOWN.items():
            if name in observers:
                v = runs.velocities(observers[name].build(runs.rig.model))[k][:, 1]
                peak = float(np.abs(v - truth)[place].max())
                speed.plot(t, (v - truth)[window], color=colour, label=f"{observers[name].title}: {peak:.2f}")
        speed.axhline(0.0, color="black", linewidth=0.8)
        speed.set_yscale("symlog", linthresh=1.0)
        speed.set(title="error of its speed, rad/s, and the largest in there", xlabel="time, s")
        speed.set_yticks([-10.0, -1.0, 0.0, 1.0, 10.0], ["-10", "-1", "0", "1", "10"])
        handles, labels = speed.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=7)
    return figure
