"""Observers of a comparison: their settings, which of them are tuned, and where the numbers come from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Protocol, cast

from pydantic import Field, field_validator

from ..models import Model
from ..observers import OBSERVERS
from ..observers.protocol import Compiled, Observer
from ..plant import CartPendulum
from ..validation import choice
from . import configs, reading
from .settings import Name, Setting, Strict


class CompiledObserver(Observer, Compiled, Protocol):
    """One that runs inside of the compiled loop."""


Tree = Any
"""Numbers inside of lists and mappings."""


class Candidate(Strict):
    """An observer, in a comparison under a name of its own."""

    title: Name
    observer: str
    settings: dict[str, Any] = Field(default={})
    """What is chosen."""
    tuned: Setting[dict[str, Any]] | None = None
    """What :func:`~smo_gym.evaluation.tuning.tune` varies, each number above 0."""

    @field_validator("observer")
    @classmethod
    def _known(cls, name: str) -> str:
        return choice("observer", name, OBSERVERS)

    def build(
        self, model: Model | CartPendulum | None = None, tuned: Mapping[str, Any] | None = None
    ) -> CompiledObserver:
        """The observer, of a model where it uses one, with other numbers than the tuned ones where some are given.

        Raises:
            ValueError: it does not take these settings.
        """
        kind: Any = OBSERVERS[self.observer]
        numbers = tuned if tuned is not None else self.tuned.value if self.tuned else {}
        given = merged(self.settings, numbers)
        if model is not None and "model" in kind.__dataclass_fields__:
            given = {"model": model, **given}
        if unknown := [name for name in given if name not in kind.__dataclass_fields__]:
            choice(f"setting of {self.observer}", unknown[0], [*kind.__dataclass_fields__])
        return cast(CompiledObserver, kind(**given))


class Candidates(Strict):
    """Observers that were tuned alike."""

    title: Name
    seed: Annotated[int, Field(ge=0)]
    """Of CMA-ES."""
    budget: Annotated[int, Field(ge=1)]
    """Evaluations of the objective that each observer gets."""
    scales: tuple[float, float]
    """The objective is the RMS error of each velocity divided by these, in sum."""
    observers: dict[str, Candidate]

    def __getitem__(self, name: str) -> Candidate:
        """A candidate by name.

        Raises:
            ValueError: there is none of this name.
        """
        return self.observers[choice("observer", name, self.observers)]


def load(path: Path) -> Candidates:
    """Candidates from a file.

    Raises:
        ValueError: it cannot be read, or has an unknown, missing or bad value, named with its place.
    """
    return reading.read(path, Candidates)


def named(name: str) -> Candidates:
    """Candidates that come with the package: "simulated", or a rig's name."""
    return load(configs.path(f"observers-{name}"))


def told(observers: Mapping[str, Candidate]) -> dict[str, Any]:
    """What each is, and its numbers with their sources."""
    return {name: each.model_dump(mode="json", exclude={"title"}) for name, each in observers.items()}


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Two trees as one; where both have a number, that of ``above``."""
    both = {
        key: merged(below[key], value)
        for key, value in above.items()
        if isinstance(value, Mapping) and isinstance(below.get(key), Mapping)
    }
    return {**below, **above, **both}


def leaves(tree: Tree, place: str = "") -> Iterator[tuple[str, float]]:
    """The numbers of a tree, each with its place."""
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from leaves(value, f"{place}.{key}" if place else str(key))
    elif isinstance(tree, list | tuple):
        for i, value in enumerate(tree):
            yield from leaves(value, f"{place}[{i}]")
    else:
        yield place, tree


def with_leaves(tree: Tree, numbers: Iterator[float]) -> Tree:
    """The same tree with other numbers."""
    if isinstance(tree, Mapping):
        return {key: with_leaves(value, numbers) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [with_leaves(value, numbers) for value in tree]
    return next(numbers)
