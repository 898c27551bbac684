"""Where a command's runs are computed: here, in other processes or on a cluster; and what is kept of them meanwhile."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from ..evaluation import store, study
from ..evaluation.pieces import Map
from ..kernels.batch import set_threads
from ..policies import named
from .arguments import Parser, whole
from .entry import Stop
from .processes import WorkerLost, in_processes

OPTIONS = ("workers", "dask")
"""Arguments that say where: no result depends on them, and no file of results names them."""
AGAIN = "nothing was written; what is done is kept, the same command goes on from there"
Measure = Callable[..., list[study.Outcome]]
"""Measures groups: :func:`smo_gym.evaluation.study.measure` with its ``map`` and ``store`` given."""


def add(parser: Parser) -> None:
    """Add the arguments that say where runs are computed."""
    parser.add_argument(
        "--workers",
        type=whole(1),
        default=1,
        metavar="N",
        help="processes that share the work, and the cores (default 1: this one); no result depends on it",
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help='of the scheduler of a Dask cluster that does the work, as tcp://host:8786 (extra "dask")',
    )


@contextmanager
def working(args: argparse.Namespace, out: Path, modules: Sequence[str] = ()) -> Iterator[tuple[Map, store.Store]]:
    """Where pieces of work are done, and what keeps what they gave until the block is done.

    Args:
        args: with those of :func:`add`.
        out: the folder for results, claimed.
        modules: of the user's own, to be imported wherever runs are computed.

    Raises:
        ValueError: two places are named, or no cluster is there.
        ImportError: the extra ``dask`` is missing.
        Stop: a worker was lost, or the command was interrupted.
    """
    with _stoppable(args, out), _place(args, modules) as mapped, store.kept(out) as kept:
        yield mapped, kept


@contextmanager
def computing(args: argparse.Namespace, out: Path | None, modules: Sequence[str] = ()) -> Iterator[Measure]:
    """How a command measures groups: as :func:`working`, and None in place of a folder keeps nothing."""
    if out is None:
        with _stoppable(args, out), _place(args, modules) as mapped:
            yield partial(study.measure, map=mapped)
    else:
        with working(args, out, modules) as (mapped, kept):
            yield partial(study.measure, map=mapped, store=kept)


@contextmanager
def _stoppable(args: argparse.Namespace, out: Path | None) -> Iterator[None]:
    if args.dask is not None and args.workers > 1:
        raise ValueError(f"--workers {args.workers} is of this machine, --dask {args.dask} of a cluster: give one")
    try:
        yield
    except WorkerLost as lost:
        raise Stop(f"error: {lost}; {AGAIN if out else 'nothing was written'}", 1) from None
    except KeyboardInterrupt:
        raise Stop(f"interrupted, {AGAIN if out else 'nothing was written'}") from None


@contextmanager
def _place(args: argparse.Namespace, modules: Sequence[str]) -> Iterator[Map]:
    def elsewhere(threads: int) -> Callable[..., _There]:
        return partial(_There, threads, tuple(modules), os.getcwd(), tuple(store.code().items()))

    if args.dask is not None:
        from . import cluster

        with cluster.mapping(args.dask) as mapped:
            there = elsewhere(1)  # Dask has a thread for each core already
            yield lambda function, pieces: mapped(there(function), pieces)
    elif args.workers > 1:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        there = elsewhere(max(1, cores // args.workers))
        yield lambda function, pieces: in_processes(args.workers, there(function), pieces)
    else:
        yield map


@dataclass(frozen=True, slots=True)
class _There:
    """A function as it is called in another process, which is made like this one first."""

    threads: int
    modules: tuple[str, ...]
    folder: str
    code: tuple[tuple[str, str], ...]
    function: Callable[[Any], Any]

    def __call__(self, piece: Any) -> Any:
        _prepare(self.threads, self.modules, self.folder, self.code)
        return self.function(piece)


@cache
def _prepare(threads: int, modules: Iterable[str], folder: str, code: Iterable[tuple[str, str]]) -> None:
    """Make a process that of a worker.

    Raises:
        ValueError: it has other code than the command, and its numbers might be others; or a module cannot be imported.
    """
    ours = store.code()
    if others := [name for name, version in code if ours[name] != version]:
        raise ValueError(f"a worker has another {', '.join(others)} than this command: give all the same")
    set_threads(threads)
    if folder not in sys.path:
        sys.path.append(folder)
    for module in modules:
        named.imported(module)
