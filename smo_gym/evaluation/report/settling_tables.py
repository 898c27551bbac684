"""The tables of ``smo-gym settle``: arms beside each other, and beside each what the compensation takes off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...article import WITH
from .. import formats
from ..estimates import Estimate, estimate, reduction
from ..settling import ARMS, SHARES, STATES, Column, Runs

MSE = tuple(f"mse_{state}" for state in STATES)
COLUMNS = (*MSE, "effort", "peak_force", "total_variation")
SPEEDS = ("estimation_rms_h_dot", "estimation_rms_theta_dot")
ERRORS = ("estimation_rms_h", "estimation_rms_theta", *SPEEDS, *SHARES)


@dataclass(frozen=True, slots=True)
class Row:
    """An arm in a column, over all rows of the table and all runs."""

    column: str
    arm: str
    runs: int
    failed: int
    means: dict[str, float]
    medians: dict[str, float]
    reductions: dict[str, Estimate]
    """What compensation takes off the arm's MSE, in percent, by state."""
    better: dict[str, int]
    """Runs whose MSE is less with compensation than on this arm, by state."""
    worse: dict[str, int]


def rows(runs: Runs) -> list[Row]:
    """All rows."""
    return [_row(runs, column, arm) for column in runs.columns for arm in ARMS]


def _row(runs: Runs, column: Column, arm: str) -> Row:
    values = {name: runs.values(column, arm, name) for name in (*COLUMNS, *ERRORS)}
    pairs = {state: runs.pair(column, arm, WITH, f"mse_{state}") for state in STATES}
    return Row(
        column.title,
        arm,
        values["mse_h"].size,
        runs.failed(column, arm),
        {name: float(np.nanmean(each)) for name, each in values.items()},
        {name: float(np.nanmedian(values[name])) for name in MSE},
        {state: estimate(reduction, *pair) for state, pair in pairs.items()},
        {state: int(np.count_nonzero(compensated < other)) for state, (other, compensated) in pairs.items()},
        {state: int(np.count_nonzero(compensated > other)) for state, (other, compensated) in pairs.items()},
    )


def as_csv(found: Sequence[Row]) -> str:
    """All numbers."""
    compared = [
        f"{state}_{what}" for state in STATES for what in ("less_percent", "ci_low", "ci_high", "better", "worse")
    ]
    header = ["column", "observer", "runs", "failed", *COLUMNS, *ERRORS, *(f"median_{name}" for name in MSE), *compared]
    lines = [
        (
            *(row.column, row.arm, row.runs, row.failed, *row.means.values(), *row.medians.values()),
            *(
                value
                for state, taken in row.reductions.items()
                for value in (taken.number, taken.low, taken.high, row.better[state], row.worse[state])
            ),
        )
        for row in found
    ]
    return formats.as_csv(header, lines)


@dataclass(frozen=True, slots=True)
class Table:
    """A column's arms, to be put into a format."""

    title: str
    header: list[str]
    lines: list[list[str]]


def tables(found: Sequence[Row], whole: bool) -> list[Table]:
    """A table for each column; the whole of it has medians and counts of runs, too."""
    titles = list(dict.fromkeys(row.column for row in found))
    return [_table(title, [row for row in found if row.column == title], whole) for title in titles]


def as_markdown(found: Sequence[Row]) -> str:
    """All tables for a file."""
    return "\n\n".join(
        f"{formats.heading(each.title, 'github', 3)}\n\n{formats.table('github', each.header, each.lines)}"
        for each in tables(found, whole=True)
    )


def _table(title: str, mine: Sequence[Row], whole: bool) -> Table:
    header = ["observer", "MSE h", "theta", "effort", "peak, N", "h', m/s", "theta'", "less h, %", "less theta, %"]
    lines = [
        [
            f"{row.arm}, {row.failed} failed" if row.failed else row.arm,
            *(f"{row.means[name]:.3g}" for name in (*MSE, "effort", "peak_force")),
            *(f"{row.means[name]:.2g}" for name in SPEEDS),
            *("" if row.arm == WITH else _taken(row.reductions[state]) for state in STATES),
        ]
        for row in mine
    ]
    if whole:
        header += ["median h", "theta", "better, worse h", "theta"]
        for line, row in zip(lines, mine, strict=True):
            line += [f"{row.medians[name]:.3g}" for name in MSE]
            line += ["" if row.arm == WITH else f"{row.better[state]}, {row.worse[state]}" for state in STATES]
    return Table(title, header, lines)


def _taken(found: Estimate) -> str:
    low, high = found.bounds
    return f"{found.number:.0f} [{low:.0f}, {high:.0f}]"
