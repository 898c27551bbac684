"""Results as one HTML file that needs no network: tables, plots, and runs that play.

Template, style and scripts are in ``assets/``. What comes from a user (names, titles, notes) is escaped by the
template; the scripts set it as text only.
"""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ... import files
from .. import between, formats
from ..arms import ARMS
from ..statistics import Result, place
from ..study import Group, Outcome
from . import page_figures, page_numbers, tables, template
from .page_traces import LEVELS, SENSED, channels, pack, runs_that_fit
from .panels import WINDOW
from .provenance import sources

_SCRIPTS = ("data.js", "cart.js", "curves.js", "tables.js", "page.js")


def check(groups: Sequence[Group], path: Path) -> None:
    """See that a report of some groups can be made and written to a file; before any run.

    Raises:
        ImportError: Plotly or Jinja is missing.
        ValueError: there are no runs to draw, or the file is a folder or in one that cannot be written to.
    """
    try:
        import jinja2  # noqa: F401
        import plotly  # noqa: F401
    except ImportError as error:
        raise ImportError(f'a report needs {error.name}: pip install "smo_gym[report]"') from None
    if not groups:
        raise ValueError("no runs to draw: no scenario has such a controller")
    if path.is_dir():
        raise ValueError(f"--report {path}: is a folder, it must be a file such as {path / 'report.html'}")
    files.prepare(path.parent, "--report")


def render(outcomes: Sequence[Outcome], results: Sequence[Result], command: str, versions: Mapping[str, str]) -> str:
    """The report as the text of one HTML file.

    Args:
        outcomes: of :func:`smo_gym.evaluation.study.measure`, with traces.
        results: of :func:`smo_gym.evaluation.statistics.results`.
        command: the command line that made them.
        versions: of what took part, by name.
    """
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    runs = runs_that_fit(outcomes)
    places, packed = pack(outcomes, runs)
    groups = [_group(outcome, where) for outcome, where in zip(outcomes, places, strict=True)]
    settings, told = sources(outcomes), channels(outcomes)
    figures = {
        "curves": page_figures.curves(SENSED[0] in told),
        "scatter": page_figures.scatter(results),
        "bars": page_figures.bars(results),
    }
    return template.filled(
        "page.html",
        _SCRIPTS,
        plotly=base64.b64encode(zlib.compress(get_plotlyjs().encode(), 9)).decode("ascii"),
        packed=packed,
        data={
            "channels": told,
            "levels": LEVELS[: len(told)].tolist(),
            "colours": {arm.name: [arm.colour, arm.colour_on_dark] for arm in ARMS.values()},
            "arms": {arm.name: arm.title for arm in ARMS.values()},
            "groups": groups,
        },
        figures=Markup(_json(figures)),
        effects=page_numbers.effects(outcomes, results),
        score=page_numbers.score(results),
        between=between.lines(outcome.group.scenario for outcome in outcomes),
        summary=tables.summary(results),
        runs=sum(len(outcome.failed) for outcome in outcomes),
        failed=sum(int(outcome.failed.sum()) for outcome in outcomes),
        shown=runs,
        most=max(len(outcome.failed) for outcome in outcomes),
        tables=_tables(outcomes, results),
        bars=list(figures["bars"]),
        arms={arm.name: arm.title for arm in ARMS.values() if any(o.group.arm == arm.name for o in outcomes)},
        rms=any(r.cell.metric == "rms" for r in results),
        diagnosed=_diagnosed(outcomes),
        settings=settings,
        sources=Counter(row["source"] for row in settings),
        window=WINDOW,
        command=command,
        versions=versions,
    )


def _json(figures: Mapping[str, Any]) -> str:
    """Figures as JSON that a script element can hold."""

    def text(figure: Any) -> str:
        if isinstance(figure, dict):
            return "{" + ",".join(f"{json.dumps(name)}:{text(value)}" for name, value in figure.items()) + "}"
        return "null" if figure is None else str(figure.to_json())

    return text(figures).replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _group(outcome: Outcome, where: Mapping[str, int | None]) -> dict[str, Any]:
    """What the page must know of a group to name, find, unpack and draw its runs."""
    group, traces, metrics = outcome.group, outcome.traces, outcome.metrics
    shown = slice(where["runs"])
    assert traces is not None
    assert outcome.plants is not None
    return {
        **where,
        "table": formats.line(group.scenario.table),
        "title": formats.line(group.scenario.title),
        "controller": formats.line(group.name),
        "name": tables.title(group.name),
        "law": group.settings.law,
        "uncertainty": f"{100 * group.uncertainty:.10g} %",
        "case": formats.line(group.case),
        "start": [float(value) for value in group.start],
        "arm": group.arm,
        "period": float(traces.time[1]) if len(traces.time) > 1 else 1.0,
        "failed": outcome.failed[shown].tolist(),
        "duration": [round(float(value), 6) for value in metrics["duration"][shown]],
        "plants": [[float(f"{value:.4g}") for value in plant] for plant in outcome.plants[shown]],
        **{name: [page_figures.short(value) for value in metrics[name][shown]] for name in ("mse_h", "mse_theta")},
    }


def _tables(outcomes: Sequence[Outcome], results: Iterable[Result]) -> list[dict[str, Any]]:
    """Each controller's tables as rows of text, with where each number lies beside the published one."""
    indices = {
        (o.group.scenario.table, o.group.name, *place(o), o.group.arm): index for index, o in enumerate(outcomes)
    }
    titles = {(o.group.scenario.table, o.group.name): o.group.scenario.title for o in outcomes}
    found = []
    for (table, name), rows in tables.by_table(results).items():
        cells = [r for r in rows if r.cell.metric in ("mse", "rms")]
        found.append(
            {
                "table": formats.line(table),
                "controller": formats.line(name),
                "name": tables.title(name),
                "title": titles[table, name],
                "verdict": tables.verdict(rows),
                "rows": [
                    {
                        "cell": r.cell,
                        "text": tables.cell_row(r),
                        "mark": _mark(r),
                        "group": indices.get(
                            (table, name, r.cell.uncertainty_percent, r.cell.case, r.cell.compensation)
                        ),
                    }
                    for r in cells
                ],
                "reductions": [
                    {"cell": r.cell, "text": tables.reduction_row(r)} for r in rows if r.cell.metric == tables.REDUCTION
                ],
            }
        )
    return found


def _diagnosed(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """The diagnostics of each table and controller, a row a metric and a column an arm: as wide as a phone."""
    header, rows = tables.diagnosed(outcomes)
    blocks: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        column = dict(zip(header, row, strict=True))
        blocks.setdefault(f"Table {column.pop('table')}, {column.pop('controller')}", []).append(column)
    found = []
    for title, columns in blocks.items():
        arms = tuple(column.pop("arm") for column in columns)
        metrics = [(name, [column[name] for column in columns]) for name in columns[0]]
        values = [(formats.typeset(name), [*map(_in_full, shown)]) for name, shown in metrics if any(shown)]
        found.append({"title": title, "arms": arms, "rows": values})
    return found


def _in_full(number: str) -> str:
    """A large number without its exponent."""
    return f"{float(number):,.0f}" if "e+" in number else number


def _mark(result: Result) -> dict[str, float | str] | None:
    """The ratio and its interval on a logarithmic axis from a half (0) to double (100), and how far off it is."""
    if not math.isfinite(result.deviation):
        return None

    def position(value: float) -> float:
        ratio = value / result.published if value > 0.0 else 0.0
        return round(50.0 + 50.0 * min(max(math.log2(ratio), -1.0), 1.0), 1) if ratio > 0.0 else 0.0

    off = math.exp(result.deviation) - 1.0
    level = next(level for level, limit in enumerate((0.1, 0.25, 0.5, math.inf)) if abs(off) <= limit)
    ends = [v if math.isfinite(v) else result.measured for v in (result.ci_low, result.ci_high)]
    return {
        "low": position(ends[0]),
        "middle": position(result.measured),
        "high": position(ends[1]),
        "look": "near" if level == 0 else f"{'above' if off > 0.0 else 'below'}-{level}",
        "sign": "" if level == 0 else "▲" if off > 0.0 else "▼",
    }
