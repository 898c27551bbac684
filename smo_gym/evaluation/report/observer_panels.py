"""Which observer when: what noise does to it against how late it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..observing import EXACT, NOISE, VELOCITIES, Row
from .figures import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {"h_dot": "h'", "theta_dot": "theta'"}
LEAST_LAG = 0.01
"""Milliseconds: less is drawn as this."""
ON_FRONT, BEHIND = "#0072B2", "#8A8A8A"


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Which points no other one is below in both numbers."""
    return [
        not any(a <= x and b <= y and (a, b) != (x, y) for j, (a, b) in enumerate(points) if j != i)
        for i, (x, y) in enumerate(points)
    ]


def draw(rows: Sequence[Row], names: Sequence[str], level: float) -> Figure:
    """Noise gain against lag of each velocity at a level of uncertainty; on the front, bold and blue."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout="constrained")
        for panel, channel in zip(figure.subplots(1, 2), VELOCITIES, strict=True):
            points = _points([r for r in rows if (r.channel, r.uncertainty) == (channel, level)])
            shown = [name for name in names if name in points]
            for name, first in zip(shown, front([points[name] for name in shown]), strict=True):
                colour = ON_FRONT if first else BEHIND
                panel.plot(*points[name], "o", color=colour, markersize=4)
                panel.annotate(name, points[name], (4, 3), textcoords="offset points", fontsize=6.5, color=colour)
            panel.set(xscale="log", yscale="log", title=f"{TITLES[channel]}, plants uncertain by {level:.0%}")
            panel.set_xlabel("|lag| on exact positions, ms")
            panel.set_ylabel("what noise adds, by its deviation, 1/s")
            panel.margins(x=0.2)
    return figure


def _points(rows: Sequence[Row]) -> Mapping[str, tuple[float, float]]:
    """Lag and noise gain of each observer that has both."""
    lag = {r.observer: max(abs(r.lag_ms), LEAST_LAG) for r in rows if r.loop == "open" and r.sensor == EXACT}
    gain = {r.observer: r.noise_gain for r in rows if r.loop == "open" and r.sensor == NOISE}
    return {
        name: (lag[name], gain[name]) for name in lag if np.isfinite(lag[name]) and 0.0 < gain.get(name, 0.0) < np.inf
    }
