"""Work in other processes of this machine, which may be killed, as this one may, at any time.

An executor of the standard library waits for ever when a worker is killed while it sends: all workers send through one
pipe. Here each has its own, whose end tells.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any, cast

ENDED = "a worker ended before its work did: it was killed, or memory was short"


class WorkerLost(Exception):
    """Who was to do the work is there no more; the message says so."""


def in_processes(workers: int, function: Callable[[Any], Any], pieces: Iterable[Any]) -> Iterator[Any]:
    """What a function gives for each piece, in the order in which they are done.

    Args:
        workers: processes, at most.
        function: that can be pickled, as pieces and what it gives can.
        pieces: of work.

    Raises:
        WorkerLost: a worker was killed.
        Exception: whatever the function raises.
    """
    waiting = list(reversed([*pieces]))
    context = multiprocessing.get_context("spawn")  # a fork would copy locks that threads of ours hold
    processes, pipes = [], []
    try:
        for _ in range(min(workers, len(waiting))):
            ours, theirs = context.Pipe()
            process = context.Process(target=_work, args=(theirs, function), daemon=True)
            with _uninterrupted():
                process.start()
            theirs.close()  # so that its end is the worker's
            processes.append(process)
            pipes.append(ours)
        for pipe in pipes:
            _send(pipe, waiting.pop())
        while pipes:
            answers = [(pipe, *_receive(pipe)) for pipe in cast("list[Connection]", wait(pipes))]
            for pipe, value, error in answers:
                if error is not None:
                    continue
                if waiting:
                    _send(pipe, waiting.pop())
                else:
                    pipes.remove(pipe)
                yield value
            for *_, error in answers:  # only now: what the others gave is not lost
                if error is not None:
                    raise error
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()


def _send(pipe: Connection, piece: Any) -> None:
    with suppress(OSError):  # its worker is gone, as the next answer will tell
        pipe.send(piece)


def _receive(pipe: Connection) -> tuple[Any, Exception | None]:
    """What a worker gave, or why there is nothing."""
    try:
        value, error = pipe.recv()
    except (EOFError, OSError):  # the pipe ends, before an answer or within
        return None, WorkerLost(ENDED)
    return value, error


def _work(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """What a worker does until its pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command, which ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        while True:
            piece = pipe.recv()
            answer: tuple[Any, Exception | None]
            try:
                answer = function(piece), None
            except Exception as error:
                error.add_note(f"in a worker:\n{traceback.format_exc()}")
                answer = None, error
            pipe.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """A child that is started here never sees Ctrl-C, not even while it imports; for this process it comes later."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
