"""The report's figures, with Plotly: published beside measured, and a run's curves for the page to fill."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .. import formats
from ..arms import ARMS
from ..statistics import Result
from . import tables

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

AXES = {
    "positions": ("h (m)", "θ (rad)", "h − ĥ (m)", "θ − θ̂ (rad)", "F (N)"),
    "velocities": ("h′ (m/s)", "θ′ (rad/s)", "h′ − ĥ′ (m/s)", "θ′ − θ̂′ (rad/s)", "F (N)"),
}
"""Titles of the panels of :func:`curves`."""
_SYMBOLS = ("circle", "diamond", "square", "triangle-up", "star", "cross")
_NEAR = 0.1


def curves(sensed: bool = False) -> Figure:
    """A run's five panels with traces that are still empty; ``meta`` says what the page fills each with.

    Args:
        sensed: whether the errors of the sensors are drawn, behind those of the estimate.
    """
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    titles = AXES["positions"]
    figure = make_subplots(rows=5, cols=1, shared_xaxes=True, vertical_spacing=0.045, subplot_titles=titles)
    figure.update_annotations(x=0.0, xanchor="left", font_size=12)
    for state in (0, 1):
        first = state == 0
        kinds: dict[str, dict[str, Any]] = {
            "truth": {"name": "true", "line": {"width": 1.8}},
            "estimate": {"name": "estimate", "line": {"width": 1.4, "dash": "dash"}},
            "reference": {"name": "reference", "line": {"width": 1.6, "dash": "dot"}},
        }
        for kind, look in kinds.items():
            meta = {"kind": kind, "state": state}
            figure.add_trace(Scatter(mode="lines", showlegend=first, legendgroup=kind, meta=meta, **look), state + 1, 1)
        if sensed:
            look = {"line": {"width": 1.0}, "name": "measured − true", "meta": {"kind": "sensor", "state": state}}
            figure.add_trace(Scatter(mode="lines", showlegend=first, **look), state + 3, 1)
        error = {"kind": "error", "state": state}
        figure.add_trace(
            Scatter(mode="lines", name="error", showlegend=False, line={"width": 1.4}, meta=error), state + 3, 1
        )
    for kind, fill in (("force_low", "none"), ("force_high", "tonexty")):
        band = Scatter(
            mode="lines", line={"width": 0}, fill=fill, hoverinfo="skip", showlegend=False, meta={"kind": kind}
        )
        figure.add_trace(band, 5, 1)
    force = Scatter(mode="lines", name="force", line={"width": 1.4}, showlegend=False, meta={"kind": "force"})
    figure.add_trace(force, 5, 1)
    figure.update_traces(hovertemplate="%{y:.4g} at %{x:.2f} s", selector={"hoverinfo": None})
    figure.update_xaxes(title_text="t (s)", row=5, col=1)
    _quiet(figure, 900, meta=AXES, showlegend=False, margin_t=44)  # the page has its key; room for Plotly's buttons
    figure.update_yaxes(automargin=False)
    return figure.update_layout(margin_autoexpand=False)  # the page's cursor relies on the margins


def scatter(results: Sequence[Result]) -> Figure | None:
    """Measured against published MSE with 95 % intervals; None where nothing is published."""
    from plotly.graph_objects import Figure, Scatter

    cells = [r for r in results if r.cell.metric == "mse" and math.isfinite(r.deviation) and not r.cell.is_average]
    if not cells:
        return None
    numbers = [value for r in cells for value in (r.published, r.measured)]
    ends = [0.7 * min(numbers), 1.4 * max(numbers)]
    figure = Figure()
    for factor, dash in ((1.0, "solid"), (1.0 + _NEAR, "dot"), (1.0 / (1.0 + _NEAR), "dot")):
        line = {"width": 1, "dash": dash}
        figure.add_trace(
            Scatter(
                x=ends,
                y=[factor * end for end in ends],
                mode="lines",
                line=line,
                hoverinfo="skip",
                showlegend=False,
                meta={"ink": True},
            )
        )
    for symbol, name in zip(_SYMBOLS * len(cells), dict.fromkeys(r.cell.controller for r in cells), strict=False):
        for arm in ARMS.values():
            chosen = [r for r in cells if (r.cell.controller, r.cell.compensation) == (name, arm.name)]
            if chosen:
                figure.add_trace(
                    Scatter(
                        x=[r.published for r in chosen],
                        y=[r.measured for r in chosen],
                        error_y=_interval(chosen) | {"thickness": 1, "width": 0, "color": arm.colour},
                        mode="markers",
                        marker={"symbol": symbol, "size": 8, "color": arm.colour, "opacity": 0.85},
                        name=html.escape(f"{tables.title(name)}, {arm.name}"),
                        text=[
                            html.escape(formats.line(f"Table {r.cell.table}, {tables.label(r.cell)}, {r.cell.state}"))
                            for r in chosen
                        ],
                        hovertemplate="%{text}<br>published %{x:.4g}<br>measured %{y:.4g}",
                    )
                )
    span = [math.log10(end) for end in ends]  # an interval may reach down to 0, which is nowhere on this axis
    axis: dict[str, Any] = {"type": "log", "range": span, "dtick": 1, "exponentformat": "power"}
    figure.update_xaxes(title_text="published MSE", **axis)
    figure.update_yaxes(title_text="measured MSE", **axis)
    return _quiet(figure, 520)


def bars(results: Sequence[Result]) -> dict[str, Figure]:
    """MSE of h above that of theta for each table and controller: published hatched, measured filled."""
    return {
        f"Table {formats.line(table)}, {tables.title(name)}": _bars([r for r in rows if r.cell.metric == "mse"])
        for (table, name), rows in tables.by_table(results).items()
    }


def _bars(cells: Sequence[Result]) -> Figure:
    from plotly.graph_objects import Bar
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, state in ((1, "h"), (2, "theta")):
        for arm in ARMS.values():
            chosen = [r for r in cells if (r.cell.state, r.cell.compensation) == (state, arm.name)]
            places = [html.escape(formats.line(tables.label(r.cell))) for r in chosen]
            look = {"x": places, "legendgroup": arm.name, "showlegend": row == 1}
            if any(math.isfinite(r.published) for r in chosen):
                hatched = {"color": arm.colour, "pattern": {"shape": "/", "fillmode": "replace", "size": 5}}
                hatched["line"] = {"color": arm.colour, "width": 1}
                values = [short(r.published) for r in chosen]
                figure.add_trace(Bar(y=values, name=f"{arm.name}, published", marker=hatched, **look), row, 1)
            if chosen:
                span = _interval(chosen) | {"thickness": 1.2, "width": 2, "color": "#888888"}
                values = [short(r.measured) for r in chosen]
                figure.add_trace(
                    Bar(y=values, error_y=span, name=f"{arm.name}, measured", marker={"color": arm.colour}, **look),
                    row,
                    1,
                )
    figure.update_traces(hovertemplate="%{x}: %{y:.4g}")
    figure.update_xaxes(type="category", automargin=True)
    figure.update_yaxes(title_text="MSE of h (m²)", row=1, col=1)
    figure.update_yaxes(title_text="MSE of θ (rad²)", row=2, col=1)
    return _quiet(figure, 520, barmode="group", bargap=0.25)


def _interval(cells: Sequence[Result]) -> dict[str, Any]:
    """95 % intervals as error bars."""
    return {
        "type": "data",
        "symmetric": False,
        "array": [short(r.ci_high - r.measured) for r in cells],
        "arrayminus": [short(r.measured - r.ci_low) for r in cells],
    }


def short(value: float) -> float | None:
    """Four digits, as many as the page shows; None for no number."""
    return float(f"{value:.4g}") if math.isfinite(value) else None


def _quiet(figure: Figure, height: int, **layout: Any) -> Figure:
    """The layout that all figures share; the page adds the colours of light or dark."""
    figure.update_xaxes(showline=False, zeroline=False, ticks="")
    figure.update_yaxes(showline=False, ticks="", automargin=True)
    figure.update_layout(
        template="none",
        height=height,
        margin={"l": 64, "r": 16, "t": 8, "b": 44},
        legend={"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom"},
        hovermode="closest",
    )
    figure.update_layout(**layout)
    return figure
