"""Recordings of a rig from CSV files: by column, corrected, and those that are known by their hash."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from ..typing import Array
from ..validation import choice
from . import logged
from .indexed import INDEX, check, entries
from .rig import Recording, Rig

SPLITS = ("train", "test")
_SAME = 0.02
"""A file whose period differs by more than this share from the rig's keeps its own."""


def load(rig: Rig, folder: Path, split: str = "test", checked: bool = True) -> tuple[Recording, ...]:
    """The recordings of a rig: ``folder/RIG/SPLIT/*.csv``, or those that lie in ``folder`` itself, or one file.

    Args:
        rig: of which.
        folder: that was named, or a file.
        split: "train" or "test".
        checked: whether all files that the folder's index names must be there and have the hashes that stand there.

    Raises:
        ValueError: there is none; one cannot be read, lacks a column, has samples that are not finite, too near to each
            other or in a time that runs backwards, has an angle in degrees, or is missing or another one than the index
            says. Nothing is used then.
    """
    choice("split", split, SPLITS)
    if folder.is_file():
        return (read(rig, folder),)
    place = folder / rig.name / split
    if checked:
        for entry in entries(folder, f"{rig.name}/{split}"):
            check(folder, entry)
    place = place if place.is_dir() else folder
    paths = _files(place)
    if not paths:
        raise ValueError(
            f"{folder}: has no recordings of {rig.name}: {folder / rig.name / split}/*.csv, or *.csv in it"
        )
    return tuple(read(rig, path) for path in paths)


def holds(rig: Rig, folder: Path) -> bool:
    """Whether a folder has recordings of a rig: a folder of its name, or files with its columns; or a file has them."""
    if (folder / rig.name).is_dir():
        return True
    first = folder if folder.is_file() else next(iter(_files(folder)), None)
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
    angle, fault = rig.corrected(log.y[:, 1])
    try:
        t = _regular(log.t, rig.period)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return Recording(path.stem, t, np.column_stack([log.y[:, 0], angle]), _late(log.u, rig.delay), fault)


def _regular(stamps: Array, period: float) -> Array:
    """Times on a grid: the sampling is regular, the stamps jitter with the computer that wrote them."""
    apart = np.diff(stamps)
    usual = float(np.median(apart))
    if (apart <= 0.0).any():
        k = int(np.argmax(apart <= 0.0)) + 1
        raise ValueError(f"time runs backwards at sample {k}: {stamps[k]:.15g} after {stamps[k - 1]:.15g}")
    period = period if abs(usual - period) < _SAME * period else usual
    steps = np.round(apart / period)
    if (steps < 1.0).any():
        k = int(np.argmax(steps < 1.0)) + 1
        raise ValueError(f"sample {k} comes {apart[k - 1]:.4g} s after the one before, where {period:.4g} s are usual")
    return np.concatenate([[0.0], np.cumsum(steps)]) * period


def _late(u: Array, delay: float) -> Array:
    """An input that arrives some samples late: over a period in between two, their mean by the time that each acts."""
    whole, rest = math.floor(delay), delay % 1.0
    padded = np.concatenate([np.full(whole + 1, u[0]), u])
    return np.asarray((1.0 - rest) * padded[1 : len(u) + 1] + rest * padded[: len(u)])


def _files(place: Path) -> list[Path]:
    return sorted((path for path in place.glob("*.csv") if path.name != INDEX), key=_order)


def _order(path: Path) -> tuple[int, str]:
    number = re.findall(r"\d+", path.stem)
    return (int(number[-1]) if number else 0, path.name)
