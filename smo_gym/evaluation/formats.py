"""Text put into a format: one escape for each, so that a name from a user is text and nothing else."""

from __future__ import annotations

import csv
import io
import re
import textwrap
from collections.abc import Iterable, Sequence
from functools import lru_cache

from tabulate import LATEX_ESCAPE_RULES, tabulate

WIDTH = 100
"""Columns that a console's text fits in."""
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_WHOLE = re.compile(r"[-+]?[0-9]+")


def line(text: str) -> str:
    """A text as one line: no breaks, no control characters, nothing that cannot be encoded."""
    text = text.encode("utf-8", "replace").decode("utf-8")
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def latex(text: str) -> str:
    """A text as LaTeX prints it."""
    return "".join(LATEX_ESCAPE_RULES.get(character, character) for character in line(text))


def markdown(text: str) -> str:
    """A text as Markdown shows it, in a heading, a paragraph or a cell of a table."""
    return re.sub(r"[\\`*_<>|~&#$]|\](?=\()", r"\\\g<0>", line(text))


def mathtext(text: str) -> str:
    """A text as Matplotlib draws it, without formulas."""
    return line(text).replace("$", r"\$")


def typeset(text: str) -> str:
    """A text as a page shows it: θ, primes and squares, and the apostrophes of words."""
    primed = re.sub(r"\b(h|theta)'(?!\w)", r"\1′", line(text))
    return re.sub(r"\btheta\b", "θ", primed).replace("'", "’").replace("^2", "²")


def escaped(text: str, form: str) -> str:
    """A text in a format of tabulate: as LaTeX, as Markdown or, on a console, as one line."""
    return latex(text) if form.startswith("latex") else markdown(text) if form == "github" else line(text)


def paragraph(text: str, form: str) -> str:
    """A text as a paragraph in a format of tabulate: on a console, in lines of at most 100 columns."""
    shown = escaped(text, form)
    return textwrap.fill(shown, WIDTH, break_long_words=False, break_on_hyphens=False) if form == "simple" else shown


def heading(text: str, form: str, level: int = 2) -> str:
    """A text as a heading in a format of tabulate."""
    shown = escaped(text, form)
    if form == "github":
        return f"{'#' * level} {shown}"
    if form.startswith("latex"):
        return f"\\{'sub' * (level - 2)}section*{{{shown}}}"
    return shown if level > 2 else f"{shown}\n{'=' * len(shown)}"


def table(form: str, header: Sequence[str], rows: Iterable[Sequence[str]], align: Sequence[str] | None = None) -> str:
    """Rows of texts as a table in a format of tabulate."""
    own = line if form.startswith("latex") else lambda text: escaped(text, form)  # tabulate itself escapes for LaTeX
    lines = [[own(text) for text in row] for row in rows]
    return tabulate(lines, [own(text) for text in header], tablefmt=form, disable_numparse=True, colalign=align)


def as_csv(header: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    """A header and lines as CSV, in which every column of numbers is wholly of one kind.

    A text that a spreadsheet would run as a formula is kept from it by an apostrophe.
    """
    columns = [_column([_field(value) for value in column]) for column in zip(*lines, strict=True)]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(zip(*columns, strict=True))
    return file.getvalue()


def is_number(text: str) -> bool:
    """Whether readers of CSV take a text for a number."""
    return _NUMBER.fullmatch(text) is not None


def _field(value: object) -> str:
    text = str(value)
    return text if is_number(text) else _plain(text)


@lru_cache
def _plain(text: str) -> str:
    text = line(text)
    return f"'{text}" if text and text[0] in "=+-@＝＋－＠" else text


def _column(texts: list[str]) -> list[str]:
    """Whole numbers among others get their point: a reader may take a column's kind from its first lines."""
    given = [text for text in texts if text]
    if not all(map(is_number, given)) or all(map(_WHOLE.fullmatch, given)):
        return texts
    return [f"{text}.0" if _WHOLE.fullmatch(text) else text for text in texts]
