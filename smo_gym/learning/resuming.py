"""A folder that holds a training: whether it is of this run, or of a shorter one that this run goes on from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import files
from ..policies.frozen import MlpPolicy
from ..validation import short
from .settings import Run

LENGTH = ("steps", "continues")
"""Settings in which a run and the one that goes on from it differ."""


def continued(path: Path, run: Run) -> tuple[dict[str, Any], Run]:
    """The settings that ``path`` should hold, and the run with what it goes on from.

    Where the file has those of a shorter run, alike in all else, they are these, and its steps join what the run
    continues.
    """
    try:
        there = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return run.plain(), run
    if isinstance(there, dict) and _but_length(there) == _but_length(run.plain()):
        steps, ends = there.get("steps"), there.get("continues", [])
        if isinstance(steps, int) and isinstance(ends, list):
            if steps < run.steps:
                return there, replace(run, continues=(*ends, steps))
            run = replace(run, continues=tuple(ends))
    return run.plain(), run


def see_best(path: Path, run: Run) -> None:
    """See now, and not when all is learned, that the best policy so far is there.

    Raises:
        ValueError: it cannot be read, or is of another run.
    """
    try:
        if _but_length(MlpPolicy.load(path).card.configuration) != _but_length(run.plain()):
            raise ValueError(f"{path}: is of another run")
    except ValueError as error:
        raise ValueError(f"{error}: the checkpoint goes on from it; empty the folder to begin anew") from None


def keep(path: Path, settings: dict[str, Any]) -> None:
    """Write a run's settings."""
    files.write(path, json.dumps(settings, indent=1) + "\n")


def _but_length(settings: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if name not in LENGTH}


def agree(path: Path, settings: dict[str, Any], begun: bool) -> None:
    """Write the settings of a run, or see that those that stand there are the same.

    Raises:
        ValueError: they are not, and the differences are named; or a run has begun here and they are missing.
    """
    wanted = json.loads(json.dumps(settings))
    if not (begun or path.exists()):
        keep(path, wanted)
        return
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict):
            raise ValueError(f"{found!r} is no mapping of settings")
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(
            f"{path}: cannot be read ({error}): it says what run the checkpoint is of; empty the folder to begin anew"
        ) from None
    if found != wanted:
        there, here = _flat(found), _flat(wanted)
        differences = [
            f"{name} is {short(there[name]) if name in there else 'missing'} there and "
            f"{short(here[name]) if name in here else 'missing'} here"
            for name in there | here
            if there.get(name) != here.get(name) or (name in there) != (name in here)
        ]
        raise ValueError(
            f"{path.parent} holds a run with another configuration: {'; '.join(differences)}. Choose another --out, or "
            "remove that folder to begin anew"
        )


def _flat(data: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Nested mappings as one, with dotted names."""
    found: dict[str, Any] = {}
    for name, value in data.items():
        found |= _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return found
