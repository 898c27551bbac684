"""What an evaluation comes to: a block of averages for each controller's table, and a few sentences of all of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .. import verdicts
from ..statistics import Result
from ..study import Outcome
from .tables import REDUCTION, by_table, ceiling, compared, title, within

STATES = ("h", "theta")


@dataclass(frozen=True, slots=True)
class Pair:
    """A published number and the measured one; NaN where there is none."""

    published: float
    measured: float


@dataclass(frozen=True, slots=True)
class Cells:
    """Published MSE cells: how many are met within 10 %, of how many, and the ceiling that ten runs set (or NaN).

    One of which no run stands is not met.
    """

    near: int
    count: int
    ceiling: float

    @classmethod
    def of(cls, rows: Iterable[Result]) -> Cells:
        """Counted in some results."""
        cells = compared(rows)
        return cls(sum(map(within, cells)), len(cells), ceiling(cells))

    @property
    def few(self) -> bool:
        """Whether fewer than half are met."""
        return 2 * self.near < self.count


@dataclass(frozen=True, slots=True)
class Average:
    """What one arm comes to: averages over the rows of its table, and its runs."""

    arm: str
    mse: tuple[Pair, ...]
    """Of h, of theta."""
    cells: Cells
    effort: float
    """In N^2 s."""
    failed: int
    runs: int


@dataclass(frozen=True, slots=True)
class Block:
    """One controller's table."""

    table: str
    controller: str
    arms: tuple[Average, ...]
    reductions: tuple[Pair, ...]
    """What the compensation takes off the averages, of h and of theta, in percent; empty without both arms."""
    cells: Cells
    cost: verdicts.Cost | None
    refused: tuple[str, ...] = ()
    """A sentence on each run that ended at a disturbance that was not finite."""

    @property
    def name(self) -> str:
        """Table and controller."""
        return f"{self.table}, {title(self.controller)}"

    @property
    def effort_ratio(self) -> float:
        """The effort with compensation over that without; NaN where there is none."""
        without, compensated = self.cost.effort if self.cost else (math.nan, math.nan)
        return compensated / without if without > 0.0 else math.nan


def blocks(outcomes: Sequence[Outcome], results: Sequence[Result]) -> list[Block]:
    """All controllers' tables. Averages leave the nominal plant out, except where there is nothing else."""
    costs = verdicts.costs(outcomes)
    found = []
    for (table, controller), rows in by_table(results).items():
        own = [o for o in outcomes if (o.group.scenario.table, o.group.name) == (table, controller)]
        reductions = [row for row in rows if row.cell.metric == REDUCTION]
        arms = dict.fromkeys(row.cell.compensation for row in rows if row.cell.metric == "mse")
        found.append(
            Block(
                table,
                controller,
                tuple(_average(arm, own, rows) for arm in arms),
                _pairs(reductions) if reductions else (),
                Cells.of(rows),
                costs.get((table, controller)),
                tuple(text for outcome in own for text in _refused(outcome)),
            )
        )
    return found


def _refused(outcome: Outcome) -> Iterable[str]:
    group = outcome.group
    case = f", case {group.case}" if group.case else ""
    where = f"Table {group.scenario.table}, {title(group.name)}, {100.0 * group.uncertainty:g} %{case}, {group.arm}"
    for run, when in enumerate(() if outcome.refused is None else outcome.refused.tolist()):
        if when > 0.0:
            yield f"Run {run} of {where}: its disturbance was not finite at t = {when:g} s"


def _average(arm: str, outcomes: Sequence[Outcome], rows: Sequence[Result]) -> Average:
    own = [o for o in outcomes if o.group.arm == arm]
    uncertain = [o for o in own if o.group.uncertainty > 0.0] or own
    efforts = np.concatenate([o.metrics["effort"][~o.failed] for o in uncertain])
    chosen = [row for row in rows if row.cell.compensation == arm and row.cell.metric == "mse"]
    return Average(
        arm,
        _pairs(chosen),
        Cells.of(chosen),
        float(efforts.mean()) if efforts.size else math.nan,
        sum(int(o.failed.sum()) for o in own),
        sum(len(o.failed) for o in own),
    )


def _pairs(rows: Sequence[Result]) -> tuple[Pair, ...]:
    """Of each state the row of averages, or the mean of what there is without one."""
    chosen = [row for row in rows if row.cell.is_average] or rows
    of_states = [[row for row in chosen if row.cell.state == state] for state in STATES]
    return tuple(
        Pair(float(np.mean([row.published for row in own])), float(np.mean([row.measured for row in own])))
        for own in of_states
    )


def words(found: Sequence[Block]) -> list[str]:
    """What the blocks say, a sentence or two each: of compensation, published cells, failures and their cause."""
    return [text for text in (_compensation(found), _published(found), _failures(found), _pushes(found)) if text]


def _compensation(found: Sequence[Block]) -> str:
    """What it does to the errors, what it costs, and what it does to the estimate."""
    changes = [
        [-block.reductions[i].measured for block in found if block.reductions and _stands(block)]
        for i in range(len(STATES))
    ]
    if not changes[0]:
        return ""
    h, theta = map(_change, changes)
    other = "of theta" if theta[0] == h[0] else f"{theta[0]} that of theta"
    text = f"Compensation {h[0]} the average MSE of h {h[1]} and {other} {theta[1]}"
    ratios = [block.effort_ratio for block in found if math.isfinite(block.effort_ratio)]
    if ratios:
        text += f", for {_span([f'{ratio:.3g}' for ratio in _ends(ratios)])} times the effort"
    costs = [block.cost for block in found if block.cost and block.cost.pairs]
    worse, pairs = sum(cost.worse for cost in costs), sum(cost.pairs for cost in costs)
    if pairs:
        text += f"; the estimate of h' is worse with it in {worse} of {pairs} runs"
    return f"{text}."


def _stands(block: Block) -> bool:
    return all(math.isfinite(pair.measured) for pair in block.reductions)


def _change(percents: Sequence[float]) -> tuple[str, str]:
    """A verb, and by how much, as it is in all of some changes."""
    low, high = _ends(percents)
    if low < 0.0 < high:
        return "changes", f"by {_span([f'{low:+.1f}', f'{high:+.1f}'])} %"
    sizes = _ends([abs(percent) for percent in percents])
    return "lowers" if low < 0.0 else "raises", f"by {_span([f'{size:.1f}' for size in sizes])} %"


def _ends(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def _span(ends: Sequence[str]) -> str:
    """Both ends, or one number where they read alike."""
    return " to ".join(dict.fromkeys(ends))


def _published(found: Sequence[Block]) -> str:
    """How many published cells are met, and which table is not reproduced."""
    blocks = [block for block in found if block.cells.count]
    if not blocks:
        return "Nothing is published for these runs to compare with."
    near, count = (sum(getattr(block.cells, name) for block in blocks) for name in ("near", "count"))
    ceilings = [block.cells.ceiling for block in blocks if math.isfinite(block.cells.ceiling)]
    text = f"Within 10 % of the published are {near} of {count} MSE cells"
    if ceilings:
        text += f", where ten runs with every setting exact would bring {sum(ceilings):.1f}"
    missed = [f"{block.name} ({block.cells.near} of {block.cells.count})" for block in blocks if block.cells.few]
    return f"{text}." + (f" Not reproduced, with fewer than half: Table {'; Table '.join(missed)}." if missed else "")


def _failures(found: Sequence[Block]) -> str:
    """Which runs failed, that no average has."""
    failed = sum(arm.failed for block in found for arm in block.arms)
    if not failed:
        return ""
    runs = sum(arm.runs for block in found for arm in block.arms)
    where = [
        f"Table {block.name}: " + ", ".join(f"{arm.arm} {arm.failed} of {arm.runs}" for arm in block.arms if arm.failed)
        for block in found
        if any(arm.failed for arm in block.arms)
    ]
    return f"{failed} of {runs} runs failed and are in no average: {'; '.join(where)}."


def _pushes(found: Sequence[Block]) -> str:
    """Where a disturbance was not finite, first and how often."""
    refused = [text for block in found for text in block.refused]
    more = (
        f", and that of {len(refused) - 1} other {'runs' if len(refused) > 2 else 'run'} at some time"
        if len(refused) > 1
        else ""
    )
    return f"{refused[0]}{more}." if refused else ""
