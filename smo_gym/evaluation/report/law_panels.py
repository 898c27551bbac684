"""Laws by what they cost: mean squares against the force's total variation, with intervals; on the front, blue."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..law_table import Row
from .figures import STYLE
from .observer_panels import BEHIND, ON_FRONT, front, neighbours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = (
    ("table-4", "no", "hanging, undisturbed"),
    ("upright", "yes", "upright, disturbed, with friction"),
)
"""Case, whether it is disturbed, and the panel's title."""
PLACE = ("ekf", "noise", 0.02)
"""Observer, sensor and control period."""
MOST_FAILED = 0.05
"""Share of runs: a law with more is not drawn, and said to be missing."""


def draw(rows: Sequence[Row], titles: Mapping[str, str]) -> Figure:
    """Panels of h above theta; a panel without rows is empty."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 8.0), layout="constrained")
        grid = figure.subplots(2, 2, sharex="col")
        for column, (case, disturbed, title) in enumerate(PANELS):
            mine = [row for row in rows if (row.case, row.disturbed) == (case, disturbed) and _there(row)]
            good = [row for row in mine if row.failures <= MOST_FAILED * row.runs]
            for panel, name, unit in zip(grid[:, column], ("h", "theta"), ("m²", "rad²"), strict=True):
                _points(panel, good, f"mse_{name}")
                panel.set_ylabel(f"MSE of {name}, {unit}")
            missing = [titles[row.law] for row in mine if row not in good]
            told = textwrap.fill(f"not drawn, falls: {', '.join(missing)}", 60) if missing else ""
            grid[0, column].set_title(title)
            grid[1, column].set_xlabel("\n".join(["total variation of the force, N", *([told] if told else [])]))
    return figure


def _there(row: Row) -> bool:
    return (row.sensor, row.control_period) == PLACE[1:] and row.observer in (PLACE[0], "steady-kalman")


def _points(axes: Axes, rows: Sequence[Row], name: str) -> None:
    points = {row.law: (row.total_variation, getattr(row, name)) for row in rows}
    best = dict(zip(points, front([*points.values()]), strict=True))
    for row in rows:
        x, y = points[row.law]
        low, high = getattr(row, f"{name}_low"), getattr(row, f"{name}_high")
        across = [[x - row.total_variation_low], [row.total_variation_high - x]]
        colour = ON_FRONT if best[row.law] else BEHIND
        axes.errorbar(x, y, [[y - low], [high - y]], across, fmt="o", ms=4, lw=0.8, color=colour)
    for together in neighbours(points, [*points], (1.12, 1.12)):
        x, y = max(points[law][0] for law in together), points[together[0]][1]
        colour = ON_FRONT if any(best[law] for law in together) else BEHIND
        told = textwrap.fill(", ".join(together), 24, break_on_hyphens=False)
        axes.annotate(told, (x, y), (5, 2), textcoords="offset points", fontsize=6.5, color=colour, va="bottom")
    axes.set(xscale="log", yscale="log")
    axes.margins(x=0.25)
