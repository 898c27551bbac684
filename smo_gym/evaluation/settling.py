"""What the compensation does: the same runs on observers with it, without it, and with constant gains in its place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..article import WITH, WITHOUT
from ..kernels.blocks import ALIVE, XHAT, Block, U, X, at, block, four, offsets
from ..observers import Gains
from ..typing import Array
from . import metrics, scenario, study
from .arms import ORACLE
from .metrics import Meter, Metric, add
from .robustness import SETTLED
from .scenario import Scenario
from .settled import STARTS, Settled, Start
from .study import Group, Outcome

MATCHED, EFFORT, BETA_1, BETA_2, TRUE = "matched", "equal effort", "tuned constant", "tuned beta_2", "true state"
CONSTANT = (MATCHED, EFFORT)
ARMS = (WITHOUT, WITH, MATCHED, EFFORT, BETA_1, BETA_2, TRUE)
"""In the tables' order."""
LAWS = {"regulation": ("lqr", "smc"), "initial-conditions": ("lqr", "smc"), "tracking": ("smc",)}
"""Controllers of each scenario."""
STATES = ("h", "theta")
MEAN_FORCE = "mean_force"
SHARES = ("error_share_h_dot", "error_share_theta_dot")
_FORCE, _PERIODS, _ERRORS, _SPEEDS, _ROWS = offsets(1, 1, 2, 2)


@block
def _close(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        going = at(signals, ALIVE, i) > 0.0
        x, xhat = four(signals, X, i), four(signals, XHAT, i)
        late = going and at(own, _PERIODS, i) >= SETTLED
        add(own, _FORCE, i, abs(at(signals, U, i)), going)
        add(own, _ERRORS, i, (xhat[2] - x[2]) * (xhat[2] - x[2]), late)
        add(own, _ERRORS + 1, i, (xhat[3] - x[3]) * (xhat[3] - x[3]), late)
        add(own, _SPEEDS, i, x[2] * x[2], late)
        add(own, _SPEEDS + 1, i, x[3] * x[3], late)
        add(own, _PERIODS, i, 1.0, going)


def _finish(rows: Array, control_period: float) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.sqrt(rows[_ERRORS:_SPEEDS] / rows[_SPEEDS:_ROWS])
        return np.array([rows[_FORCE] / rows[_PERIODS], *shares])


_BLOCK: Block = _close
METER = Meter(
    "settling",
    (
        Metric(MEAN_FORCE, "N", "mean of |u| over the control periods"),
        Metric(SHARES[0], "", "RMS of the estimate of h' less h' over RMS of h', after 2000 control periods"),
        Metric(SHARES[1], "", "the same of theta'"),
    ),
    _ROWS,
    _finish,
    close=_BLOCK,
)


named = cache(scenario.named)
"""A scenario of ours by name; each is read once."""


def measuring() -> AbstractContextManager[None]:
    """While it lasts, runs also measure the mean force, and errors of the velocities as shares of these."""
    return metrics.measuring([METER])


@dataclass(frozen=True, slots=True)
class Column:
    """What arms are compared in: a scenario, a controller and where the observer begins."""

    scenario: str
    controller: str
    start: Start

    @property
    def title(self) -> str:
        """In tables."""
        table = {"regulation": "4", "initial-conditions": "5", "tracking": "7"}[self.scenario]
        return f"Table {table} {self.controller.upper()} from {'0' if self.start == 'zero' else 'y(0)'}"

    def place(self, gains: Mapping[str, Any] | None = None) -> Scenario:
        """Its scenario, with the observer's start and, where some are given, other gains."""
        place = named(self.scenario).from_one_start()
        settings = place.controllers[self.controller]
        observer = settings.observer
        if self.start == "measured":
            observer = observer.changed(xhat0="measured")
        if gains is not None:
            observer = observer.changed(gains=dict(gains))
        return place.changed(controllers={self.controller: settings.changed(observer=observer)})

    @property
    def printed(self) -> Gains:
        """The gains of Table 3."""
        return Gains.of(named(self.scenario).controllers[self.controller].observer.gains.value)

    def constant(self, c: float) -> dict[str, Any]:
        """The printed gains as if |u| were always c newtons."""
        printed = self.printed
        beta_1 = tuple((np.array(printed.beta_1) + c * np.array(printed.beta_2)).tolist())
        return {"m1": printed.m1, "beta_1": beta_1, "beta_2": (0.0, 0.0)}

    def tuned(self, name: str, values: Sequence[float]) -> dict[str, Any]:
        """Gains that are constant, or the printed ones with another beta_2."""
        printed = self.printed
        given = {"beta_1": values, "beta_2": (0.0, 0.0)} if name == BETA_1 else {"beta_2": values}
        return {"m1": printed.m1, "beta_1": printed.beta_1, **{key: tuple(value) for key, value in given.items()}}

    def gains(self, arm: str, found: Settled) -> dict[str, Any] | None:
        """The gains of an arm; None are the printed ones."""
        if arm in CONSTANT:
            matched = found.matched[self.scenario][self.controller][self.start]
            return self.constant((matched.mean if arm == MATCHED else matched.effort).value)
        if arm in (BETA_1, BETA_2):
            trained = "regulation" if self.scenario == "initial-conditions" else self.scenario
            tuned = found.tuned[trained][self.controller][self.start]
            return self.tuned(arm, (tuned.beta_1 if arm == BETA_1 else tuned.beta_2).value)
        return None

    def groups(self, arm: str, found: Settled, runs: int) -> list[Group]:
        """An arm's groups."""
        observer = {WITHOUT: WITHOUT, TRUE: ORACLE}.get(arm, WITH)
        return study.groups([self.place(self.gains(arm, found))], [self.controller], [observer], runs)


COLUMNS = tuple(
    Column(name, controller, start) for name, laws in LAWS.items() for controller in laws for start in STARTS
)
Place = tuple[Column, str]
"""A column and an arm."""


def wanted(found: Settled, runs: int, columns: Iterable[Column] = COLUMNS) -> dict[Place, list[Group]]:
    """All groups of the comparison."""
    return {(column, arm): column.groups(arm, found, runs) for column in columns for arm in ARMS}


class Runs:
    """What all runs gave, by column and arm: run r is on the same plant in all of them."""

    def __init__(self, outcomes: Mapping[Place, Sequence[Outcome]]) -> None:
        self.outcomes = outcomes
        self.columns = tuple(dict.fromkeys(column for column, _ in outcomes))

    def values(self, column: Column, arm: str, metric: str, level: float | None = None) -> Array:
        """A metric by row of the table and run, (rows, runs), NaN where a run failed.

        Args:
            column: and
            arm: whose runs.
            metric: its name.
            level: rows of this level of uncertainty alone; None for all but the nominal plant's.
        """
        rows = [
            np.where(each.failed, np.nan, each.metrics[metric])
            for each in self.outcomes[column, arm]
            if (each.group.uncertainty > 0.0 if level is None else each.group.uncertainty == level)
        ]
        return np.array(rows)

    def pair(self, column: Column, one: str, other: str, metric: str, level: float | None = None) -> tuple[Array, ...]:
        """The same of two arms, over the runs that failed in neither."""
        both = self.values(column, one, metric, level), self.values(column, other, metric, level)
        stood = np.isfinite(both[0]).all(0) & np.isfinite(both[1]).all(0)
        return both[0][:, stood], both[1][:, stood]

    def failed(self, column: Column, arm: str) -> int:
        """How many runs failed."""
        return sum(int(each.failed.sum()) for each in self.outcomes[column, arm])
