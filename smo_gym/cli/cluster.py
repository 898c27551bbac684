"""Work on a cluster of Dask's, which gives what a lost worker has left undone to another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

from ..evaluation.pieces import Map
from .processes import WorkerLost

try:
    import distributed
except ImportError as error:
    raise ImportError('--dask needs distributed: pip install "smo_gym[dask]"') from error

PATIENCE = "10s"
"""How long to wait for the scheduler."""


@contextmanager
def mapping(address: str) -> Iterator[Map]:
    """A function like the builtin ``map`` whose calls are done on a cluster, in any order.

    Args:
        address: of the scheduler.

    Raises:
        ValueError: nobody answers there.
    """
    try:
        distributed.comm.addressing.get_address_host_port(
            address
        )  # a client of what is no address leaves a trace when it goes
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        raise ValueError(f"--dask {address}: no scheduler answers there ({' '.join(str(error).split())})") from None
    with client:

        def mapped(function: Callable[[Any], Any], pieces: Iterable[Any]) -> Iterator[Any]:
            futures = client.map(function, [*pieces], pure=False)
            try:
                for _, found in distributed.as_completed(futures, with_results=True, loop=client.loop):  # type: ignore[no-untyped-call]
                    yield found
            except distributed.KilledWorker:
                raise WorkerLost("workers were lost again and again on one piece of work") from None
            except (CancelledError, OSError) as error:
                raise WorkerLost(f"the cluster at {address} was lost") from error

        yield mapped
