"""The theorem's runs, some at a time, so that what is done is kept when the rest is stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..controllers import LQR
from ..observers import SlidingModeObserver
from ..plant import CartPendulum
from ..theorem import OperatingSet
from ..typing import Array
from .settings import TheoremSettings
from .store import Store, digest
from .theorem_on_runs import Convergence, converge

RUNS = 500
"""Of a piece: some seconds' work."""
_OF_RUNS = ("stayed", "promised", "reached", "promised_velocity", "velocity_error", "bounded", "velocity_settled")


def drawn(settings: TheoremSettings, over: OperatingSet, runs: int, seed: int) -> tuple[Array, Array]:
    """Random starts x(0), (runs, 4), and plants [M_c, m, l, g], (runs, 4)."""
    rng = np.random.default_rng(seed)
    low, high = np.array(settings.starts.value)
    starts = rng.uniform(low, high, (runs, 4))
    return starts, np.array([CartPendulum().draw(over.uncertainty, rng).as_array() for _ in range(runs)])


def converge_in_pieces(
    observers: Mapping[str, SlidingModeObserver],
    agent: LQR,
    over: OperatingSet,
    starts: Array,
    plants: Array,
    *,
    force: float,
    horizon: float,
    settle: float,
    store: Store | None,
    progress: Callable[[int], object] = lambda runs: None,
) -> Convergence:
    """As :func:`~smo_gym.evaluation.theorem_on_runs.converge`, to the same bits; finished pieces are kept in ``store``.

    Args:
        observers: by name; the first one feeds the agent.
        agent: control law.
        over: the operating set.
        starts: x(0), (n, 4).
        plants: [M_c, m, l, g], (n, 4).
        force: that the observers' steps are stable up to, in N.
        horizon: length of the runs in s.
        settle: where the RMS of the velocity errors begins, in s.
        store: keeps pieces and gives those of before; None keeps nothing.
        progress: called with the number of runs done since the last call.
    """

    def run(mine: slice) -> Convergence:
        return converge(observers, agent, over, starts[mine], plants[mine], force=force, horizon=horizon, settle=settle)

    pieces = []
    for first in range(0, len(starts), RUNS):
        mine = slice(first, first + RUNS)
        told = [repr(observers), agent.K.tolist(), agent.wrap, repr(over)]
        told += [starts[mine].tolist(), plants[mine].tolist(), force, horizon, settle]
        key = digest(told)
        kept = None if store is None else store.read(key)
        found = _from(kept) if kept else run(mine)
        if store is not None and kept is None:
            store.write(key, _arrays(found))
        pieces.append(found)
        progress(len(found.stayed))
    return joined(pieces)


def joined(pieces: Sequence[Convergence]) -> Convergence:
    """Runs of several pieces as those of one."""
    runs: dict[str, Any] = {
        name: np.concatenate([getattr(piece, name) for piece in pieces], axis=-1) for name in _OF_RUNS
    }
    squares = {name: np.concatenate([piece.squares[name] for piece in pieces], axis=-1) for name in pieces[0].squares}
    largest = np.max([piece.largest for piece in pieces], axis=0)
    return replace(pieces[0], **runs, squares=squares, largest=largest)


def _arrays(found: Convergence) -> dict[str, Any]:
    plain = {field.name: getattr(found, field.name) for field in fields(found) if field.name != "squares"}
    return plain | {f"squares:{name}": total for name, total in found.squares.items()}


def _from(arrays: Mapping[str, Any]) -> Convergence:
    squares = {name.partition(":")[2]: total for name, total in arrays.items() if name.startswith("squares:")}
    plain = {name: values if values.ndim else values.item() for name, values in arrays.items() if ":" not in name}
    return Convergence(**plain, squares=squares)
