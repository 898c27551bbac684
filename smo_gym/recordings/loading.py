"""Recordings of a rig from CSV files: by column, corrected, and those that are known by their hash."""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from ..typing import Array
from ..validation import choice
from . import logged
from .rig import Recording, Rig

INDEX = "index.csv"
"""In the folder of all recordings: files, hashes and where they come from."""
SPLITS = ("train", "test")
_SAME = 0.02
"""A file whose period differs by more than this share from the rig's keeps its own."""


def load(rig: Rig, folder: Path, split: str = "test", checked: bool = True) -> tuple[Recording, ...]:
    """The recordings of a rig, ``folder/RIG/SPLIT/*.csv``, or those that lie in ``folder`` itself.

    Args:
        rig: of which.
        folder: that was named.
        split: "train" or "test".
        checked: whether a file that the folder's index names must have the hash that stands there.

    Raises:
        ValueError: there is none; one cannot be read, lacks a column, has samples that are not finite or a time that
            runs backwards, has an angle in degrees, or is another one than the index says. Nothing is used then.
    """
    choice("split", split, SPLITS)
    place = folder / rig.name / split
    place = place if place.is_dir() else folder
    paths = sorted(place.glob("*.csv"), key=_order)
    paths = [path for path in paths if path.name != INDEX]
    if not paths:
        raise ValueError(
            f"{folder}: has no recordings of {rig.name}: {folder / rig.name / split}/*.csv, or *.csv in it"
        )
    if checked:
        known = _index(folder)
        for path in paths:
            _check(path, known.get(path.relative_to(folder).as_posix()))
    return tuple(read(rig, path) for path in paths)


def holds(rig: Rig, folder: Path) -> bool:
    """Whether a folder has recordings of a rig: a folder of its name, or files with its columns."""
    if (folder / rig.name).is_dir():
        return True
    first = next(iter(sorted(folder.glob("*.csv"))), None)
    try:
        return first is not None and {*rig.columns} <= {*logged.columns(first)}
    except ValueError:
        return False


def read(rig: Rig, path: Path) -> Recording:
    """One recording.

    Raises:
        ValueError: as of :func:`load`.
    """
    log = logged.read(path, rig.columns[1:3], rig.columns[3], rig.columns[0])
    if len(log.t) < 2:
        raise ValueError(f"{path}: has {len(log.t)} sample, at least 2 must be")
    for name, values in zip(rig.columns, (log.t, *log.y.T, log.u), strict=True):
        if not np.isfinite(values).all():
            raise ValueError(f"{path}: {name} of sample {int(np.argmin(np.isfinite(values)))} is not finite")
    steps = np.diff(log.t)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0)) + 1
        raise ValueError(f"{path}: time runs backwards at sample {k}: {log.t[k]!r} after {log.t[k - 1]!r}")
    angle, fault = rig.corrected(log.y[:, 1])
    return Recording(
        path.stem, _regular(steps, rig.period), np.column_stack([log.y[:, 0], angle]), _late(log.u, rig.delay), fault
    )


def _regular(steps: Array, period: float) -> Array:
    """Times on a grid: the sampling is regular, the stamps jitter with the computer that wrote them."""
    usual = float(np.median(steps))
    period = period if abs(usual - period) < _SAME * period else usual
    return np.concatenate([[0.0], np.cumsum(period * np.maximum(np.round(steps / period), 1.0))])


def _late(u: Array, delay: float) -> Array:
    """An input that arrives some samples late: over a period in between two, their mean by the time that each acts."""
    whole, rest = math.floor(delay), delay % 1.0
    padded = np.concatenate([np.full(whole + 1, u[0]), u])
    return np.asarray((1.0 - rest) * padded[1 : len(u) + 1] + rest * padded[: len(u)])


def _order(path: Path) -> tuple[int, str]:
    number = re.findall(r"\d+", path.stem)
    return (int(number[-1]) if number else 0, path.name)


@cache
def _index(folder: Path) -> Mapping[str, str]:
    path = folder / INDEX
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {row["file"]: row["sha256"] for row in csv.DictReader(file)}


def _check(path: Path, known: str | None) -> None:
    if known is not None and (found := hashlib.sha256(path.read_bytes()).hexdigest()) != known:
        raise ValueError(
            f"{path}: is not the file that {INDEX} names (its SHA-256 is {found}, not {known}): nothing is used"
        )
