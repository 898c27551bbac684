"""Tables and paragraphs no wider than a console."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from tabulate import tabulate

from ..evaluation.formats import WIDTH

_LEAST = 8
"""Columns that a column of a table has at least."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the widest of its columns are broken between words until it fits."""
    limits = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    text = tabulate(rows, header, disable_numparse=True)
    while _width(text) > WIDTH and max(limits) > _LEAST:
        limits[limits.index(max(limits))] -= 1
        lines = [[_broken(cell, most) for cell, most in zip(line, limits, strict=True)] for line in (header, *rows)]
        text = tabulate(lines[1:], lines[0], disable_numparse=True)
    return text


def _broken(cell: str, most: int) -> str:
    return textwrap.fill(cell, most, break_on_hyphens=False, break_long_words=False)


def paragraph(text: str) -> str:
    """Lines of words."""
    kept = text.replace(" %", "\0%")  # no line begins with the sign
    return textwrap.fill(kept, WIDTH, break_on_hyphens=False, break_long_words=False).replace("\0%", " %")


def _width(text: str) -> int:
    return max(map(len, text.splitlines()), default=0)


class Told:
    """Text that is told line by line: whole for a file, narrow for a console."""

    def __init__(self) -> None:
        self.whole, self.shown = "", ""

    def say(self, text: str) -> None:
        """A paragraph or several lines."""
        self.whole += f"{text}\n"
        self.shown += "\n".join(map(paragraph, text.split("\n"))) + "\n"

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]], end: str = "\n") -> None:
        """A table, and what follows it."""
        self.whole += tabulate(rows, header, disable_numparse=True) + end
        self.shown += table(header, rows) + end.lstrip(" ")


def pair(values: Iterable[float]) -> str:
    """Two numbers to read."""
    return ", ".join(f"{value:.3g}" for value in values)
