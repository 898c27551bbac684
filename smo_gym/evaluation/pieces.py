"""How a study is cut into pieces of work, and what it asks of those who run them and keep what they gave."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, Protocol

SLOTS = 256
"""Groups are added to a piece until it has so many: enough for the compiled batch, about a second's work."""
Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Runs a function on pieces: as the builtin does, or elsewhere, and then in any order."""


class Keeper(Protocol):
    """Keeps what groups gave, as :class:`smo_gym.evaluation.store.Store` does in a folder."""

    def key(self, group: Any, seed: int, samples: int | None) -> str | None:
        """What stands for all that a group depends on; None where that cannot be said."""
        ...

    def get(self, key: str, group: Any) -> Any | None:
        """What is kept of a group."""
        ...

    def put(self, key: str, outcome: Any) -> None:
        """Keep what a group gave."""
        ...


def cut(kinds: Sequence[Hashable], slots: Sequence[int]) -> list[list[int]]:
    """Indices of groups, a list for each piece: of one kind, and of :data:`SLOTS` slots and less than a group more.

    Args:
        kinds: of each group, what those of one batch share.
        slots: of each group.
    """
    pieces: list[list[int]] = []
    growing: dict[Hashable, list[int]] = {}
    for index, kind in enumerate(kinds):
        if kind not in growing:
            pieces.append(growing.setdefault(kind, []))
        growing[kind].append(index)
        if sum(slots[i] for i in growing[kind]) >= SLOTS:
            del growing[kind]
    return pieces
