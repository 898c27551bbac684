"""Tables that sort and pictures as one HTML file that needs no network."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from tabulate import tabulate

from ..formats import typeset
from . import provenance, template
from .figures import encode

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure


class Table(NamedTuple):
    """Cells as they are shown; the first of a row names it."""

    title: str
    """What stands before its colon is the heading, the rest is told beneath."""
    header: Sequence[str]
    rows: Sequence[Sequence[str | int]]


class Origin(NamedTuple):
    """Where the numbers come from."""

    command: str
    """The line that makes them again."""
    versions: Mapping[str, str]
    settings: Mapping[str, Any]
    """A tree, in which those with a source are ``{value, source, note}``."""


def check() -> None:
    """See that a page can be made; before any run.

    Raises:
        ImportError: Jinja or Matplotlib is missing.
    """
    try:
        import jinja2  # noqa: F401
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ImportError(f'a report needs {error.name}: pip install "smo_gym[report,plots]"') from None


def render(title: str, told: str, tables: Sequence[Table], figures: Mapping[str, Figure], origin: Origin) -> str:
    """The page as the text of one HTML file.

    Args:
        title: of the page.
        told: how it was measured, in a paragraph.
        tables: one below the other.
        figures: by caption.
        origin: of the numbers.
    """
    settings = provenance.settings(origin.settings)
    return template.filled(
        "tables.html",
        ["sort.js"],
        title=typeset(title),
        told=typeset(told),
        tables=[_shown(table) for table in tables],
        pictures={typeset(caption): _drawn(figure) for caption, figure in figures.items()},
        settings=settings,
        sources=Counter(row["source"] for row in settings),
        command=origin.command,
        versions=origin.versions,
    )


def text(tables: Sequence[Table], form: str) -> str:
    """The same tables in a format of tabulate."""
    return "\n\n".join(
        f"{table.title}\n\n{tabulate(table.rows, table.header, form, disable_numparse=True)}" for table in tables
    )


def _shown(table: Table) -> dict[str, Any]:
    heading, _, note = typeset(table.title).partition(": ")
    return {
        "heading": heading,
        "note": note[:1].upper() + note[1:],
        "header": [*map(typeset, table.header)],
        "rows": [[typeset(str(cell)) for cell in row] for row in table.rows],
    }


def _drawn(figure: Figure) -> Markup:
    """A figure as an element, without what only a file of its own begins with."""
    from markupsafe import Markup

    text = encode(figure, "svg").decode()
    return Markup(text[text.index("<svg") :])
