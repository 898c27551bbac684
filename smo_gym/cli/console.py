"""Standard output and error that never stop a command: the console does not decide over results."""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

from ..evaluation.formats import WIDTH

if TYPE_CHECKING:
    from rich.console import Console as Screen

NARROW = 80
"""Columns that there are at least: a narrower terminal wraps lines itself."""


class Console:
    """A stream that is dropped where it cannot be written to; the first error is kept.

    Args:
        stream: to write to; None where it was closed before the command began.
    """

    def __init__(self, stream: TextIO | None) -> None:
        self.error: OSError | None = None
        self._stream = io.StringIO() if stream is None else stream
        if isinstance(self._stream, io.TextIOWrapper):  # of a character that its encoding lacks, the code
            self._stream.reconfigure(errors="backslashreplace")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or drop."""
        try:
            return self._stream.write(text)
        except OSError as error:
            self._drop(error)
            return len(text)

    def flush(self) -> None:
        """Flush, or drop."""
        try:
            self._stream.flush()
        except OSError as error:
            self._drop(error)

    def _drop(self, error: OSError) -> None:
        self.error = self.error or error
        with suppress(OSError):  # what is still buffered goes nowhere, else the interpreter would fail on it at its end
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


@contextmanager
def guarded() -> Iterator[tuple[Console, Console]]:
    """Standard output and error as consoles, while a block runs."""
    streams = sys.stdout, sys.stderr
    consoles = Console(sys.stdout), Console(sys.stderr)
    sys.stdout, sys.stderr = (cast(TextIO, console) for console in consoles)
    try:
        yield consoles
    finally:
        for console in consoles:
            console.flush()
        sys.stdout, sys.stderr = streams


def screen() -> Screen:
    """Standard output for rich text: of the terminal's width within bounds, plain where it is none.

    Colours follow the terminal, NO_COLOR and FORCE_COLOR.
    """
    from rich.console import Console as Screen

    width = min(max(shutil.get_terminal_size((WIDTH, 0)).columns, NARROW), WIDTH)
    return Screen(file=sys.stdout, width=width, highlight=False, markup=False, emoji=False, force_jupyter=False)
