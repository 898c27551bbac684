"""The one entry of all commands: errors in one line, Ctrl-C, exit codes."""

from __future__ import annotations

import errno
import functools
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from . import starting
from .console import guarded
from .starting import INTERRUPTED

Main = Callable[[Sequence[str] | None], int]


class Stop(Exception):
    """The end of a command, with what to say and its exit code."""

    def __init__(self, message: str, code: int = INTERRUPTED) -> None:
        super().__init__(message)
        self.code = code


def command(of: str) -> Callable[[Main], Callable[..., int]]:
    """Make a function of the arguments a command, which returns its exit code and raises nothing that was foreseen.

    0 when all went well; 2 for a bad argument or setting or a missing extra; 1 for what could not be written; 130 when
    interrupted. A console that cannot be written to stops nothing; the code is 1 where output was lost, 0 where its
    reader has left.

    Args:
        of: the command's name; messages have what the user typed to run it.
    """

    def decorate(main: Main) -> Callable[..., int]:
        @functools.wraps(main)
        def run(arguments: Sequence[str] | None = None) -> int:
            name = starting.called(of)
            with guarded() as (output, _), _interruptible(name) as interrupted:
                code, message = _outcome(main, arguments, interrupted)
                if message:
                    print(f"{name}: {message}", file=sys.stderr)
                output.flush()
                if output.error is not None and output.error.errno != errno.EPIPE:
                    why = output.error.strerror
                    print(f"{name}: error: standard output cannot be written to ({why})", file=sys.stderr)
                    code = code or 1
            return code

        return run

    return decorate


def _outcome(main: Main, arguments: Sequence[str] | None, interrupted: list[bool]) -> tuple[int, str]:
    """A command's exit code and what there is to say of it."""
    try:
        return main(arguments), ""
    except SystemExit as done:  # --help and --version
        return (done.code if isinstance(done.code, int) else 0), ""
    except Stop as stop:
        return stop.code, str(stop)
    except KeyboardInterrupt:
        return INTERRUPTED, "interrupted, nothing was written"
    except Exception as error:
        if interrupted:  # some libraries make another error of it while they are imported
            return INTERRUPTED, "interrupted, nothing was written"
        if isinstance(error, OSError):
            return 1, f"error: {said(error)}"
        if isinstance(error, MemoryError):
            return 1, f"error: out of memory {error}".rstrip()
        if isinstance(error, ValueError | ImportError):
            return 2, f"error: {error}"
        raise


def typed(of: str, arguments: Sequence[str] | None) -> str:
    """The line that runs a command again, in the way that its user ran it.

    Args:
        of: the command's name.
        arguments: as given to it; None are those of the process.
    """
    given = sys.argv[1:] if arguments is None else arguments
    return f"{starting.line(of)} {shlex.join(given)}".rstrip()


def said(error: OSError) -> str:
    """What went wrong with which file."""
    return f"{error.filename}: {error.strerror}" if error.filename else error.strerror or str(error)


@contextmanager
def _interruptible(name: str) -> Iterator[list[bool]]:
    """Ctrl-C raises KeyboardInterrupt and leaves a note, the second ends the process; unless the parent ignores it."""
    noted: list[bool] = []
    before = signal.getsignal(signal.SIGINT)
    if before in (signal.SIG_IGN, None) or threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, frame: FrameType | None) -> None:
        if noted:
            starting.leave(name)
        noted.append(True)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)
