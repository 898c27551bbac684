"""Which observer when: what noise does to it against how late it is."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..observing import EXACT, NOISE, VELOCITIES, Row
from .figures import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

TITLES = {"h_dot": "h'", "theta_dot": "theta'"}
LEAST_LAG = 0.01
"""Milliseconds: less is drawn as this."""
NEAR = (3.0, 1.45)
"""Factors of lag and noise gain within which points share a label."""
ON_FRONT, BEHIND = "#0072B2", "#6B6B6B"


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Which points no other one is below in both numbers."""
    return [
        not any(a <= x and b <= y and (a, b) != (x, y) for j, (a, b) in enumerate(points) if j != i)
        for i, (x, y) in enumerate(points)
    ]


def neighbours(
    points: Mapping[str, tuple[float, float]], names: Sequence[str], near: tuple[float, float] = NEAR
) -> list[list[str]]:
    """Names of points that are within factors on logarithmic axes, so that one label tells of them."""
    found: list[list[str]] = []
    for name in sorted(names, key=lambda name: points[name][1]):
        x, y = points[name]
        for group in found:
            a, b = points[group[0]]
            if max(a / x, x / a) < near[0] and y / b < near[1]:
                group.append(name)
                break
        else:
            found.append([name])
    return found


def draw(rows: Sequence[Row], names: Sequence[str], level: float) -> Figure:
    """Noise gain against lag of each velocity at a level of uncertainty; on the front, bold and blue."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout="constrained")
        labels: list[Annotation] = []
        for panel, channel in zip(figure.subplots(1, 2), VELOCITIES, strict=True):
            points = _points([r for r in rows if (r.channel, r.uncertainty) == (channel, level)])
            shown = [name for name in names if name in points]
            best = dict(zip(shown, front([points[name] for name in shown]), strict=True))
            for name in shown:
                panel.plot(*points[name], "o", color=ON_FRONT if best[name] else BEHIND, markersize=4)
            for together in neighbours(points, shown):
                colour = ON_FRONT if any(best[name] for name in together) else BEHIND
                told = textwrap.fill(", ".join(together), 26, break_on_hyphens=False)
                place = max(points[name][0] for name in together), points[together[0]][1]
                style = {"fontsize": 6.5, "color": colour, "va": "center", "linespacing": 1.05}
                line = {
                    "arrowstyle": "-",
                    "color": colour,
                    "linewidth": 0.4,
                    "shrinkA": 0,
                    "shrinkB": 2,
                    "relpos": (0, 0.5),
                }
                labels.append(panel.annotate(told, place, (6, 0), textcoords="offset points", arrowprops=line, **style))
            panel.set(xscale="log", yscale="log", title=f"{TITLES[channel]}, plants uncertain by {level:.0%}")
            panel.set_xlabel("|lag| on exact positions, ms")
            panel.set_ylabel("what noise adds, by its deviation, 1/s")
            panel.margins(x=0.25)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        _spread(figure, labels)
    return figure


def _spread(figure: Figure, labels: Sequence[Annotation]) -> None:
    """Move labels down until none lies on another or on a point, from the highest on."""
    from matplotlib.text import Text

    placed: list[Bbox] = [line.get_window_extent() for panel in figure.axes for line in panel.lines]
    points = 72.0 / figure.dpi
    for label in sorted(labels, key=lambda label: -label.get_window_extent().y1):
        while True:
            box = Text.get_window_extent(label)
            below = [other.y0 for other in placed if box.overlaps(other)]
            if not below:
                break
            x, y = label.xyann
            label.xyann = (x, y - points * (box.y1 - min(below) + 1.0))
        placed.append(box)


def _points(rows: Sequence[Row]) -> Mapping[str, tuple[float, float]]:
    """Lag and noise gain of each observer that has both."""
    lag = {r.observer: max(abs(r.lag_ms), LEAST_LAG) for r in rows if r.loop == "open" and r.sensor == EXACT}
    gain = {r.observer: r.noise_gain for r in rows if r.loop == "open" and r.sensor == NOISE}
    return {
        name: (lag[name], gain[name]) for name in lag if np.isfinite(lag[name]) and 0.0 < gain.get(name, 0.0) < np.inf
    }
