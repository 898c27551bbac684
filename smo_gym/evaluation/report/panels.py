"""What the article's figures are made of: panels of trajectories of all runs, and of bars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...article import WITH, WITHOUT
from ...typing import Array
from ..arms import ARMS, PRINTED
from ..formats import mathtext
from ..statistics import Result
from ..study import Outcome
from ..traces import Traces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


COLOURS = {
    "lqr": {WITHOUT: "#56B4E9", WITH: "#000000"},  # cyan, black
    "smc": {WITHOUT: "#D55E00", WITH: "#000000"},  # red, black
    "smc-tracking": {WITHOUT: "#CC79A7", WITH: "#005F45"},  # purple, green (darker, for a print in grey)
}
"""Colours of each published controller's arms, by the article's captions."""
TITLES = {"lqr": "LQR", "smc": "SMC", "smc-tracking": "SMC tracking"}
Columns = Mapping[str, Sequence[Outcome]]
"""What each column of panels shows, by its title."""
WINDOW = 0.25
"""Length in s of the window that chattering is averaged over."""
_POSITIONS = (("h", "m"), ("\\theta", "rad"))
START = 2.0
"""Length in s of the start that is shown at every control instant."""
_SWITCHING = 0.05  # s, at the end of the start: some switchings of a force that chatters
_WIDTH = 5.5  # in: the text of a page; letters of 9 pt can still be read in a column, and from the back of a room
_BAR_KINDS = ("published", "measured")


def columns_by(key: Literal["name", "arm"], outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """The outcomes of each column by its title, in the article's order."""
    titles = TITLES if key == "name" else {arm: ARMS[arm].title for arm in PRINTED}
    found = {title: [o for o in outcomes if getattr(o.group, key) == value] for value, title in titles.items()}
    return {title: chosen for title, chosen in found.items() if chosen}


def states(columns: Columns) -> Figure:
    """Positions h above theta, with the reference where there is one."""
    figure, axes = _panels(2, len(columns), 4.0, sharex=True, sharey="row")
    for column, (title, chosen) in zip(axes.T, columns.items(), strict=True):
        for j, panel in enumerate(column):
            for outcome in chosen:
                traces = traced(outcome)
                _lines(panel, outcome, traces.x[:, j], label=title != ARMS[outcome.group.arm].title)
            if traces.x_d is not None:
                panel.plot(traces.time, traces.x_d[:, j], color="black", linewidth=1.2, label="reference")
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"${state}$ ({unit})")
    return _finished(figure, axes, list(columns))


def errors(outcomes: Sequence[Outcome], starts: Sequence[Outcome]) -> Figure:
    """Errors h - hhat above theta - thetahat, over the entire simulation and, beside it, at its start."""
    columns = {"entire simulation": outcomes, f"first {START:g} s, every step": starts}
    figure, axes = _panels(2, 2, 4.0, sharex="col", sharey="row")
    for column, chosen in zip(axes.T, columns.values(), strict=True):
        for j, panel in enumerate(column):
            for outcome in chosen:
                traces = traced(outcome)
                until = START if chosen is starts else math.inf
                _lines(panel, outcome, traces.x[:, j] - traces.xhat[:, j], until, label=chosen is outcomes)
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"${state} - \\hat{{{state}}}$ ({unit})")
    return _finished(figure, axes, list(columns))


def inputs(columns: Columns, starts: Sequence[Outcome]) -> Figure:
    """The force without above with compensation: each run's mean and the range of all; of SMC's, its switching too."""
    arms = [arm for arm in PRINTED if any(o.group.arm == arm for chosen in columns.values() for o in chosen)]
    switching = [o for o in starts if o.group.settings.law == "smc"]
    titles = [*columns, *([f"one plant, {1000 * _SWITCHING:g} ms"] if switching else [])]
    ratios = [3] * len(columns) + [2] * (len(titles) - len(columns))
    figure, axes = _panels(
        len(arms), len(titles), 0.6 + 1.7 * len(arms), width_ratios=ratios, sharex="col", sharey=True
    )
    for column, chosen in zip(axes.T, columns.values(), strict=False):
        for outcome in chosen:
            _force(column[arms.index(outcome.group.arm)], outcome)
        column[0].plot([], [], color="0.3", linewidth=0.8, label=f"mean over {WINDOW:g} s")
        column[0].fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="range")
    for outcome in switching:
        _switching(axes[arms.index(outcome.group.arm), -1], outcome)
    for panel, arm in zip(axes[:, 0], arms, strict=True):
        panel.set_ylabel(f"{ARMS[arm].title}\n$F$ (N)".replace(" comp", "\ncomp"))
    return _finished(figure, axes, titles)


def _force(panel: Axes, outcome: Outcome) -> None:
    """The range of all runs' forces, and each run's mean."""
    traces = traced(outcome)
    low, high = (_alive(outcome, values) for values in (traces.u_low, traces.u_high))
    some = np.isfinite(low).any(axis=1)
    span = (np.nanmin(low[some], axis=1), np.nanmax(high[some], axis=1))
    panel.fill_between(traces.time[some], *span, step="pre", color=_colour(outcome), alpha=0.2, linewidth=0.0)
    _lines(panel, outcome, smooth(traces.time, traces.u_mean), label=False)


def _switching(panel: Axes, outcome: Outcome) -> None:
    """The first run's force over every control period at the end of the start, as it is held."""
    time, force = traced(outcome).time, _alive(outcome, traced(outcome).u)[:, 0]
    until = min(START, time[-1])
    shown = (time >= until - _SWITCHING - 1e-9) & (time <= until + 1e-9)
    panel.plot(time[shown], force[shown], color=_colour(outcome), linewidth=0.8, drawstyle="steps-pre")
    panel.locator_params(axis="x", nbins=2)


def bars(columns: Mapping[str, Sequence[Result]], label: str) -> Figure:
    """MSE of h above that of theta: the published bars beside ours and their intervals.

    Args:
        columns: results of each column by its controller's published name.
        label: of what the groups of bars are.
    """
    figure, axes = _panels(2, len(columns), 4.7, sharex="col", sharey="row")
    for column, (name, results) in zip(axes.T, columns.items(), strict=True):
        for panel, state in zip(column, ("h", "theta"), strict=True):
            _bars(panel, name, [r for r in results if r.cell.state == state])
        _legend(column[0], TITLES[name], wide=len(columns) == 1)
        column[1].set_xlabel(label)
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"MSE of ${state}$ ({unit}$^2$)")
    return figure


def _bars(panel: Axes, name: str, cells: Sequence[Result]) -> None:
    """Bars beside each other: without published, without measured, with published, with measured."""
    places = [
        ", ".join(filter(None, (r.cell.case and f"case {mathtext(r.cell.case)}", r.cell.uncertainty_percent)))
        for r in cells
    ]
    ticks = list(dict.fromkeys(places))
    bars = [(arm, kind) for arm in PRINTED if any(r.cell.compensation == arm for r in cells) for kind in _BAR_KINDS]
    width = 0.84 / len(bars)
    for k, (arm, kind) in enumerate(bars):
        chosen = [(ticks.index(place), r) for place, r in zip(places, cells, strict=True) if r.cell.compensation == arm]
        colour = COLOURS[name][arm]
        middle = [tick + (k - (len(bars) - 1) / 2) * width for tick, _ in chosen]
        height = np.array([getattr(r, kind) for _, r in chosen])
        look: dict[str, Any] = {"edgecolor": colour, "linewidth": 0.6, "label": f"{arm}, {kind}"}
        if kind == "published":
            panel.bar(middle, height, width, facecolor="white", hatch="///////", **look)
        else:
            span = np.array([(r.measured - r.ci_low, r.ci_high - r.measured) for _, r in chosen]).T
            grey = {"linewidth": 0.9, "ecolor": "0.5"}
            span = np.maximum(span, 0.0)  # equal but for rounding where all runs agree
            panel.bar(middle, height, width, facecolor=colour, yerr=span, error_kw=grey, **look)
    panel.set_xticks(range(len(ticks)), ticks)
    panel.grid(visible=False, axis="x")


def smooth(time: Array, force: Array) -> Array:
    """Forces (m, runs) averaged over :data:`WINDOW`, or over what there is of it at either end."""
    window = max(int(np.searchsorted(time, WINDOW)), 1)
    from scipy.ndimage import uniform_filter1d  # only who draws waits for it

    total, share = (uniform_filter1d(a, window, axis=0, mode="constant") for a in (force, np.ones((len(time), 1))))
    return np.asarray(total / share)


def traced(outcome: Outcome) -> Traces:
    """An outcome's traces.

    Raises:
        ValueError: it has none.
    """
    if outcome.traces is None:
        raise ValueError(f"{outcome.group.name} has no traces to draw: measure() was asked for no samples")
    return outcome.traces


def _alive(outcome: Outcome, values: Array) -> Array:
    """Values (m, runs) without those after a run's failure."""
    traces = traced(outcome)
    duration = outcome.metrics["duration"][: values.shape[1]]
    return np.where(traces.time[:, None] <= duration + 1e-9, values, np.nan)


def _lines(panel: Axes, outcome: Outcome, values: Array, until: float = math.inf, label: bool = True) -> None:
    """One line a run of values (m, runs)."""
    time = traced(outcome).time
    shown = time <= until
    lines = panel.plot(time[shown], _alive(outcome, values)[shown], color=_colour(outcome), linewidth=0.8, alpha=0.85)
    if label:
        lines[0].set_label(ARMS[outcome.group.arm].title)


def _colour(outcome: Outcome) -> str:
    return COLOURS[outcome.group.name][outcome.group.arm]


def _panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure of a page's width and its panels (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _finished(figure: Figure, axes: NDArray[Any], titles: Sequence[str]) -> Figure:
    """What all figures of trajectories share: titles, axis of time, legends."""
    for column, title in zip(axes.T, titles, strict=True):
        _legend(column[0], title, wide=len(titles) == 1)
        column[-1].set_xlabel("$t$ (s)")
    for panel in axes.flat:
        panel.margins(x=0.0)
        panel.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    return figure


def _legend(panel: Axes, title: str, wide: bool) -> None:
    """A legend above the panel, where no line runs through it; a title alone where nothing has a name."""
    if panel.get_legend_handles_labels()[1]:
        panel.legend(title=title, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2 if wide else 1)
    else:
        panel.set_title(title)
