"""Results as tables to read (console, Markdown, LaTeX) and as data (CSV)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, fields, replace

import numpy as np

from ...article import Cell
from .. import formats, metrics, verdicts
from ..arms import ARMS
from ..formats import as_csv
from ..statistics import Result
from ..study import Outcome

HEADER = ("", "state", "arm", "published", "measured", "95 % interval", "median", "ratio", "failed")
REDUCTION_HEADER = ("", "state", "published %", "measured %", "95 % interval", "median")
REDUCTION = "mse_reduction_percent"


def by_table(results: Iterable[Result]) -> dict[tuple[str, str], list[Result]]:
    """The results of each table and controller."""
    tables: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        tables.setdefault((result.cell.table, result.cell.controller), []).append(result)
    return tables


def render(results: Sequence[Result], form: str, *, rms: bool) -> str:
    """Every table beside the published one, with its verdict.

    Args:
        results: of :func:`smo_gym.evaluation.statistics.results`.
        form: a format of tabulate: "simple" for a console, "github" for Markdown, "latex_booktabs".
        rms: whether to show the RMS rows, which are the roots of the MSE rows, too.
    """
    parts = []
    for (table, controller), rows in by_table(results).items():
        parts.append(formats.heading(f"Table {table}, {title(controller)}", form))
        shown = [row for row in rows if row.cell.metric == "mse" or (rms and row.cell.metric == "rms")]
        # on a console no column of zeros, which would make lines longer than 100 columns: the verdict counts failures
        columns = len(HEADER) - (form == "simple" and not any(row.failures for row in shown))
        parts.append(_table(form, HEADER[:columns], [cell_row(row)[:columns] for row in shown]))
        reductions = [row for row in rows if row.cell.metric == REDUCTION]
        if reductions:
            parts.append(formats.heading("Reduction of the MSE by the compensation", form, level=3))
            parts.append(_table(form, REDUCTION_HEADER, [reduction_row(row) for row in reductions]))
        parts.append(formats.paragraph(verdict(rows), form))
    return "\n\n".join(parts) + "\n"


def verdict(rows: Sequence[Result]) -> str:
    """How one controller's table compares with the published one, in a sentence."""
    mse = [row for row in rows if row.cell.metric == "mse"]
    counted = [row for row in mse if row.cell.state == "h" and not row.cell.is_average]
    failed = f"{sum(row.failures for row in counted)} of {sum(row.runs for row in counted)} runs failed."
    cells = compared(rows)
    off = np.array([row.deviation for row in cells if math.isfinite(row.deviation)])
    averages = [row.deviation for row in mse if row.cell.is_average and math.isfinite(row.deviation)]
    if not off.size:
        none = f"{len(cells)} published MSE cells: no run stands" if cells else "No published cell to compare with"
        return f"{none}. {failed}"
    furthest = off[np.argmax(np.abs(off))]
    most = ceiling(cells)
    return (
        f"{len(cells)} published MSE cells: RMS of log(measured/published) {100 * np.sqrt(np.mean(off**2)):.1f} %, "
        f"{sum(map(within, cells))} within 10 %"
        + (f" (means of ten runs would come to {most:.1f} with every setting exact), " if math.isfinite(most) else ", ")
        + f"furthest off {100 * np.expm1(furthest):+z.1f} %. "
        + (f"Averages off {', '.join(f'{100 * np.expm1(a):+z.1f} %' for a in averages)}. " if averages else "")
        + failed
    )


def title(controller: str) -> str:
    """A controller's name in capitals, a path or class as it is."""
    return controller.upper() if re.fullmatch(r"[\w -]*", controller) else formats.line(controller)


def compared(results: Iterable[Result]) -> list[Result]:
    """The published MSE cells. One in which no run stands is missed, not left out."""
    return [r for r in results if r.cell.metric == "mse" and not r.cell.is_average and r.published > 0.0]


def within(result: Result) -> bool:
    """Whether a measured number is within 10 % of the published one."""
    return bool(abs(math.expm1(result.deviation)) <= 0.1)


def ceiling(cells: Iterable[Result]) -> float:
    """How many cells means of ten runs would meet with every setting exact; NaN from ten runs or fewer."""
    chances = [row.ceiling for row in cells if math.isfinite(row.deviation)]
    return sum(chances) if chances else math.nan


def summary(results: Sequence[Result]) -> str:
    """How many published MSE cells are met."""
    cells = compared(results)
    if not cells:
        return "Nothing is published for these runs to compare with."
    near = sum(map(within, cells))
    inside = sum(r.ci_low <= r.published <= r.ci_high for r in cells)
    foreseen = sum(abs(r.published - r.measured) <= r.half_width for r in cells)
    fallen = sum(not math.isfinite(r.deviation) for r in cells)
    return (
        f"{len(cells)} published MSE cells in all: {near} within 10 %, {inside} within the 95 % interval of our mean, "
        f"{foreseen} within that of another mean of ten runs, where 95 % would be {0.95 * len(cells):.0f}."
        + (f" In {fallen} no run stands, so missed." if fallen else "")
    )


def diagnostics(outcomes: Sequence[Outcome], form: str) -> str:
    """What the runs showed beside their MSE: tables, registered metrics, and what the compensation costs."""
    header, rows = diagnosed(outcomes)
    parts = []
    for name, columns in _PARTS.items():
        if any(any(row[columns]) for row in rows):
            parts.append(formats.heading(f"Diagnostics: {name}", form, level=3))
            parts.append(_table(form, *_columns(columns, header, rows)))
    lines = (*(f"{metric.name}: {metric.label}" for metric in metrics.registered()), *verdicts.cost_lines(outcomes))
    return "\n\n".join([*parts, *(formats.paragraph(line, form) for line in lines)])


def _columns(
    columns: slice, header: tuple[str, ...], rows: Sequence[tuple[str, ...]]
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Some columns behind those that say where a row stands."""
    cut = [(*line[:_PLACE], *line[columns]) for line in (header, *rows)]
    return cut[0], cut[1:]


def diagnosed(outcomes: Sequence[Outcome]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of what the runs showed beside their MSE, a mean over each controller's runs that did not fail.

    Registered metrics stand behind ours. The last column counts the runs that left the operating set which the
    theorem's gains are designed for.
    """
    shown = _DIAGNOSTICS | {metric.name: f"{metric.name}, {metric.unit}" for metric in metrics.registered()}
    header = ("table", "controller", "arm", *shown.values(), "left the set")
    rows = []
    keys = dict.fromkeys((o.group.scenario.table, o.group.name) for o in outcomes)
    for table, controller in keys:
        for arm in ARMS:
            chosen = [
                o
                for o in outcomes
                if (o.group.scenario.table, o.group.name, o.group.arm) == (table, controller, arm)
                and o.group.uncertainty > 0.0
            ]
            if chosen:
                columns = [np.concatenate([o.metrics[name][~o.failed] for o in chosen]) for name in shown]
                means = [f"{values.mean():.3g}" if values.size else "" for values in columns]
                left = [o.left for o in chosen if o.left is not None]
                count = f"{np.concatenate(left).sum()} of {sum(map(len, left))}" if left else ""
                rows.append((table, title(controller), arm, *means, count))
    return header, rows


_DIAGNOSTICS = {
    "estimation_rms_h": "est. h, m",
    "estimation_rms_theta": "est. theta, rad",
    "estimation_rms_h_dot": "est. h', m/s",
    "estimation_rms_theta_dot": "est. theta', rad/s",
    "effort": "effort, N^2 s",
    "total_variation": "variation, N",
    "peak_h": "peak h, m",
    "peak_theta": "peak theta, rad",
    "peak_force": "peak F, N",
}
_PLACE = 3
"""Table, controller, arm: the first columns of the diagnostics."""
_PARTS = {
    "RMS errors of the estimate": slice(_PLACE, 7),
    "effort and variation of the force": slice(7, 9),
    "peaks": slice(9, 12),
    "registered metrics, and runs that left the operating set of the theorem's gains": slice(12, None),
}
"""Tables that the diagnostics are shown in, each narrow enough for a console."""


def results_csv(results: Sequence[Result]) -> str:
    """One line a result: the columns of the published data, what stands beside it, and what kind of row it is in.

    A row of averages has neither level of uncertainty nor case.
    """
    numbers = ("published", "measured", "ci_low", "ci_high", "runs", "failures", "median")

    def values(result: Result) -> list[object]:
        cell = result.cell
        where = replace(cell, uncertainty_percent="", case="") if cell.is_average else cell
        kind = "average" if cell.is_average else "cell"
        return [*asdict(where).values(), *(exact(getattr(result, name)) for name in numbers), kind]

    return as_csv([*(field.name for field in fields(Cell)), *numbers, "row"], map(values, results))


def runs_csv(outcomes: Sequence[Outcome]) -> str:
    """One line a run, with every metric."""
    header = ["table", "controller", "uncertainty", "case", "arm", "run", "failed", *metrics.names()]

    def lines() -> Iterable[list[object]]:
        for outcome in outcomes:
            group = outcome.group
            place = [group.scenario.table, group.name, group.uncertainty, group.case, group.arm]
            for run, failed in enumerate(outcome.failed):
                yield [*place, run, int(failed), *(exact(outcome.metrics[name][run]) for name in metrics.names())]

    return as_csv(header, lines())


def exact(value: float) -> object:
    """The shortest text that reads back as the same number; empty for none."""
    if isinstance(value, int):
        return value
    return repr(float(value)) if math.isfinite(value) else ""


def label(cell: Cell) -> str:
    """A cell's row: its case, its level of uncertainty, or both."""
    if cell.is_average:
        return "average"
    parts = [f"case {cell.case}"] * bool(cell.case) + [f"{cell.uncertainty_percent} %"] * bool(cell.uncertainty_percent)
    return ", ".join(parts)


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else ""


def cell_row(row: Result) -> tuple[str, ...]:
    """A result under :data:`HEADER`."""
    ratio = math.exp(row.deviation)
    state = row.cell.state if row.cell.metric == "mse" else f"{row.cell.metric.upper()} {row.cell.state}"
    return (
        label(row.cell),
        state,
        row.cell.compensation,
        _number(row.published),
        _number(row.measured),
        _span(row, _number),
        _number(row.median),
        f"{ratio:.3f}" if math.isfinite(ratio) else "",
        f"{row.failures} of {row.runs}" if row.failures else "0",
    )


def reduction_row(row: Result) -> tuple[str, ...]:
    """A reduction under :data:`REDUCTION_HEADER`."""

    def percent(value: float) -> str:
        return f"{value:z.1f}" if math.isfinite(value) else ""

    numbers = (percent(row.published), percent(row.measured), _span(row, percent), percent(row.median))
    return (label(row.cell), row.cell.state, *numbers)


def _span(row: Result, text: Callable[[float], str]) -> str:
    return f"[{text(row.ci_low)}, {text(row.ci_high)}]" if math.isfinite(row.ci_low) else ""


def _table(form: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return formats.table(form, header, rows, ["left"] * 2 + ["right"] * (len(header) - 2))
