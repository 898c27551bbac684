"""The article against itself: what its printed cells say of its printed averages, roots and reductions."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np

from . import WITH, WITHOUT, published

REGULATION = ("4",)  # the only regulation table with RMS columns


@dataclass(frozen=True, slots=True)
class Check:
    """A printed number beside what the printed cells give, by one definition or by two."""

    table: str
    controller: str
    row: str
    quantity: str
    state: str
    compensation: str
    printed: float
    recomputed: float
    alternative: float
    """A reduction as the mean of the rows' reductions; NaN where there is one definition only."""
    tolerance: float
    """What rounding in print can account for."""

    @property
    def agrees(self) -> str:
        """One of "yes", "as the mean of reductions" and "no"."""
        if abs(self.printed - self.recomputed) <= self.tolerance:
            return "yes"
        if abs(self.printed - self.alternative) <= self.tolerance:
            return "as the mean of reductions"
        return "no"


def checks() -> list[Check]:
    """Every printed average, reduction and RMS cell, and the abstract's two claims."""
    return [*_roots(), *_summaries()]


def _roots() -> Iterator[Check]:
    """Each RMS cell beside the root of its MSE cell."""
    for cell, rms in published().items():
        if cell.metric == "rms":
            mse = published()[replace(cell, metric="mse")]
            yield Check(
                cell.table,
                cell.controller,
                f"{cell.uncertainty_percent} %",
                "rms",
                cell.state,
                cell.compensation,
                rms,
                math.sqrt(mse),
                math.nan,
                1e-4,
            )


def _summaries() -> Iterator[Check]:
    text = resources.files(__package__).joinpath("printed.csv").read_text(encoding="utf-8")
    for line in csv.DictReader(text.splitlines()):
        printed = float(line.pop("value"))
        table, state, quantity = line["table"], line["state"], line["quantity"]
        alternative, tolerance = math.nan, 0.02
        if table == "abstract":
            recomputed = max(_reduction(t, c, "rms", state) for t in REGULATION for c in ("lqr", "smc"))
            tolerance = 0.5
        elif quantity.endswith("reduction"):
            metric = quantity.split()[0]
            case = None if line["row"] == "average" else line["row"]
            recomputed = _reduction(table, line["controller"], metric, state, case)
            if case is None:
                without, with_ = (_column(table, line["controller"], metric, state, arm) for arm in (WITHOUT, WITH))
                alternative = float(np.mean(100.0 * (1.0 - with_ / without)))
        else:
            recomputed = float(np.mean(_column(table, line["controller"], quantity, state, line["compensation"])))
            tolerance = 1e-3 * printed
        yield Check(
            table,
            line["controller"],
            line["row"],
            quantity,
            state,
            line["compensation"],
            printed,
            recomputed,
            alternative,
            tolerance,
        )


def _column(table: str, controller: str, metric: str, state: str, arm: str, case: str | None = None) -> np.ndarray:
    """The printed cells of a column, or of one case."""
    wanted = (table, controller, metric, state, arm)
    return np.array(
        [
            value
            for cell, value in published().items()
            if (cell.table, cell.controller, cell.metric, cell.state, cell.compensation) == wanted
            and case in (None, cell.case)
        ]
    )


def _reduction(table: str, controller: str, metric: str, state: str, case: str | None = None) -> float:
    """The reduction of the average over rows by the compensation, in percent."""
    without, with_ = (np.mean(_column(table, controller, metric, state, arm, case)) for arm in (WITHOUT, WITH))
    return float(100.0 * (1.0 - with_ / without))
