"""Laws by what they cost: mean squares against the force's total variation, with 95 % intervals."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..law_table import Row
from .figures import STYLE

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
FARTHEST = 100.0
"""Times the laws' median of the MSE of h: farther ones are not drawn either."""
COLOURS = {
    "smc": "#D55E00",
    "lqr": "#8A8A8A",
    "linear": "#000000",
    "surface": "#009E73",
    "integral-sliding-mode": "#0072B2",
    "pi": "#CC79A7",
    "mpc": "#E69F00",
}
"""After Okabe and Ito, by the kind of law; PI on the sliding variable has one of its own."""
MARKERS = "osD^vP*X"


def styles(kinds: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each law, from its kind."""
    found: dict[str, tuple[str, str]] = {}
    for name, kind in kinds.items():
        used = sum(colour == COLOURS[kind] for colour, _ in found.values())
        found[name] = COLOURS[kind], MARKERS[used % len(MARKERS)]
    return found


def draw(rows: Sequence[Row], titles: Mapping[str, str], kinds: Mapping[str, str]) -> Figure:
    """Panels of h above theta, a column for each of :data:`PANELS` that there are rows of.

    Args:
        rows: of the table.
        titles: of the laws.
        kinds: of the laws, keys of :data:`COLOURS`.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [(title, found) for case, pushed, title in PANELS if (found := _there(rows, case, pushed))]
    looks = styles(kinds)
    with rc_context(STYLE):
        figure = Figure(figsize=(3.2 + 3.2 * max(len(shown), 1), 6.4), layout="constrained")
        drawn: dict[str, Any] = {}
        grid = figure.subplots(2, max(len(shown), 1), sharex="col", squeeze=False)
        for column, (title, mine) in enumerate(shown):
            usual = float(np.nanmedian([row.mse_h for row in mine]))
            good = [r for r in mine if r.failures <= MOST_FAILED * r.runs and r.mse_h < FARTHEST * usual]
            for panel, name, unit in zip(grid[:, column], ("h", "theta"), ("m²", "rad²"), strict=True):
                drawn |= _points(panel, good, f"mse_{name}", looks)
                panel.set(xscale="log", yscale="log", ylabel=f"MSE of {name}, {unit}")
            missing = ", ".join(titles[row.law] for row in mine if row not in good)
            told = textwrap.fill(f"not drawn, fall or drive the cart away: {missing}", 48) if missing else ""
            grid[0, column].set_title(title)
            grid[1, column].set_xlabel("\n".join(["total variation of the force, N", *([told] if told else [])]))
        order = [name for name in titles if name in drawn]
        figure.legend(
            [drawn[name] for name in order], [titles[name] for name in order], loc="outside right center", frameon=False
        )
    return figure


FRONTS = (
    ("table-4", "no", "hanging, undisturbed"),
    ("table-4", "yes", "the same, plants 35 % off"),
    ("upright", "no", "upright, disturbed"),
    ("upright", "yes", "the same, 35 %, another force"),
)
"""Case, whether it is outside of what was tuned on, and the panel's title."""


def draw_front(rows: Sequence[Row], titles: Mapping[str, str], kinds: Mapping[str, str]) -> Figure:
    """Each law as a line through what it was tuned to, for smoother and for rougher forces; h above theta.

    Args:
        rows: of :func:`smo_gym.evaluation.law_front.points`.
        titles: of the laws.
        kinds: of the laws, keys of :data:`COLOURS`.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    looks = styles(kinds)
    with rc_context(STYLE):
        figure = Figure(figsize=(14.0, 6.0), layout="constrained")
        grid = figure.subplots(2, len(FRONTS))
        drawn: dict[str, Any] = {}
        for column, (case, outside, title) in enumerate(FRONTS):
            mine = [r for r in rows if (r.case, r.outside) == (case, outside) and r.failures <= MOST_FAILED * r.runs]
            for panel, name, unit in zip(grid[:, column], ("h", "theta"), ("m²", "rad²"), strict=True):
                for law in dict.fromkeys(row.law for row in mine):
                    line = sorted((r.total_variation, getattr(r, f"mse_{name}")) for r in mine if r.law == law)
                    colour, marker = looks[law]
                    x, y = zip(*line, strict=True)
                    (drawn[law],) = panel.plot(x, y, marker=marker, ms=4, lw=1.0, color=colour)
                panel.set(xscale="log", yscale="log")
                panel.xaxis.set_minor_formatter(NullFormatter())
                if column == 0:
                    panel.set_ylabel(f"MSE of {name}, {unit}")
            grid[0, column].set_title(title)
            grid[1, column].set_xlabel("total variation of the force, N")
        order = [name for name in titles if name in drawn]
        labels = [titles[name] for name in order]
        figure.legend([drawn[name] for name in order], labels, loc="outside right center", frameon=False)
    return figure


def _there(rows: Sequence[Row], case: str, disturbed: str) -> list[Row]:
    observers = (PLACE[0], "steady-kalman")
    place = (case, disturbed, *PLACE[1:])
    return [r for r in rows if (r.case, r.disturbed, r.sensor, r.control_period) == place and r.observer in observers]


def _points(panel: Axes, rows: Sequence[Row], name: str, looks: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for row in rows:
        x, y = row.total_variation, getattr(row, name)
        low, high = getattr(row, f"{name}_low"), getattr(row, f"{name}_high")
        across = [[x - row.total_variation_low], [row.total_variation_high - x]]
        colour, marker = looks[row.law]
        found[row.law] = panel.errorbar(
            x, y, [[y - low], [high - y]], across, fmt=marker, ms=5, mew=0.5, mec="white", lw=0.8, color=colour
        )
    return found
