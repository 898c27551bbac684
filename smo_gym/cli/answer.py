"""The answer of an evaluation on a console."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..evaluation import formats
from ..evaluation.report.answer import Block, Cells, Pair
from .console import screen

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

COMPARED = "Each table: what the compensation changes; below it, averages over the rows."
AVERAGES = "Each table's averages over its rows."
HEADER = (
    *("\ntable", *(f"{of}\n{kind}" for of in ("MSE of h", "of theta") for kind in ("published", "measured"))),
    *("cells\nin 10 %", "ten runs\nat best", "effort,\nN^2 s"),
)
FEW_RUNS = "What ten runs would meet at best takes more than ten runs a cell to tell: --runs 100 shows it."
_GOOD, _BAD, _HEAD, _COST = "green", "red", "bold", "yellow"


def show(found: Sequence[Block], sentences: Sequence[str], between: Sequence[str] = ()) -> None:
    """Print what stands between, the blocks as one table of the columns that are not empty, and the sentences."""
    from rich.box import Box
    from rich.table import Table

    console = screen()
    gap = int(console.width == formats.WIDTH)  # beside the one of the box
    ruled = Box("    \n    \n -- \n" + "    \n" * 5, ascii=True)
    table = Table(box=ruled, show_edge=False, pad_edge=False, padding=(0, gap, 0, 0))
    rows = [row for block in found for row in _rows(block)]
    filled = [i for i in range(len(HEADER)) if any(row[i].plain for row in rows)]
    for i in filled:
        right = i > 0
        table.add_column(HEADER[i], justify="right" if right else "left", no_wrap=right, overflow="fold")
    for row in rows:
        table.add_row(*(row[i] for i in filled))
    _say(console, between)
    console.print(COMPARED if any(block.reductions for block in found) else AVERAGES, style=_HEAD)
    console.print(table)
    cells = [block.cells for block in found if block.cells.count]
    few_runs = bool(cells) and not any(math.isfinite(each.ceiling) for each in cells)
    _say(console, [*sentences, *[FEW_RUNS] * few_runs])
    console.file.flush()


def _say(console: Console, sentences: Sequence[str]) -> None:
    for text in sentences:
        console.print(textwrap.fill(formats.line(text), console.width, break_on_hyphens=False), soft_wrap=True)


def _rows(block: Block) -> list[tuple[Text, ...]]:
    """A block's head, what the compensation changes, and a row for each arm."""
    from rich.text import Text

    changes = [_change(value) for pair in block.reductions for value in (pair.published, pair.measured)] or [Text()] * 4
    ratio = block.effort_ratio
    times = Text(f"x {ratio:.3g}" if math.isfinite(ratio) else "", _COST if ratio > 1.0 else _GOOD)
    head = (Text(formats.line(block.name), _HEAD), *changes, *_cells(block.cells), times)
    arms = [
        (
            Text(f"  {arm.arm}"),
            *(Text(text) for pair in arm.mse for text in _pair(pair)),
            *_cells(arm.cells),
            Text(_effort(arm.effort)),
        )
        for arm in block.arms
    ]
    return [head, *arms]


def _pair(pair: Pair) -> tuple[str, str]:
    published, measured = (f"{value:.3g}" if math.isfinite(value) else "" for value in (pair.published, pair.measured))
    return published, measured


def _change(reduction: float) -> Text:
    from rich.text import Text

    if not math.isfinite(reduction):
        return Text()
    return Text(f"{-reduction:+z.1f} %", _GOOD if reduction > 0.0 else _BAD)


def _cells(cells: Cells) -> tuple[Text, Text]:
    from rich.text import Text

    if not cells.count:
        return Text(), Text()
    ceiling = f"{cells.ceiling:.1f}" if math.isfinite(cells.ceiling) else ""
    return Text(f"{cells.near} of {cells.count}", _BAD if cells.few else ""), Text(ceiling)


def _effort(value: float) -> str:
    """Three digits, without an exponent where that is short."""
    return f"{float(f'{value:.3g}'):,g}" if math.isfinite(value) else ""
