"""Logged positions and inputs of a plant, from a CSV file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..typing import Array
from ..validation import unknown

TIME = ("time", "t")
COUNTS_A_TURN = 360.0
MOST_SPEED = 60.0
"""rad/s: an angle that changes faster through a whole log is one in degrees."""


@dataclass(frozen=True, slots=True)
class Log:
    """Samples in the order of time."""

    t: Array
    """In s, (samples,)."""
    y: Array
    """Positions, (samples, 2)."""
    u: Array
    """Input from each sample to the next, (samples,)."""


def read(path: Path, positions: Sequence[str], given: str, time: str | None = None, degrees: bool | None = None) -> Log:
    """A log from the columns of a CSV file with a header; lines that begin with # are comments.

    The second position is an angle, which is unwrapped where it jumps by half a turn and more.

    Args:
        path: of the file.
        positions: columns of both positions.
        given: column of the input.
        time: column of the time in s; None for "time" or "t".
        degrees: whether the angle is in degrees; None for an angle in radians that must look like one.

    Raises:
        ValueError: the file cannot be read, has no such column, or a value that is no number, or an angle that looks
            like one in degrees.
    """
    names, lines = _table(path)
    clock = time or next((name for name in TIME if name in names), TIME[0])
    wanted = [clock, *positions, given]
    for name in wanted:
        if name not in names:
            raise ValueError(f"{path}: {unknown('column', name, names)}")
    places = [names.index(name) for name in wanted]
    values = np.array([[_number(path, k, row, place) for place in places] for k, row in enumerate(lines, 2)])
    if len(values) == 0:
        raise ValueError(f"{path}: has no samples")
    t, y, u = values[:, 0], values[:, 1:3].copy(), values[:, 3]
    if degrees:
        y[:, 1] *= math.pi / 180.0
    y[:, 1] = np.unwrap(y[:, 1], period=2.0 * math.pi)
    if degrees is None and (why := _looks_like_degrees(t, values[:, 2])):
        raise ValueError(f"{path}: {positions[1]} {why}: is it in degrees? (observe takes --degrees and --radians)")
    return Log(t, y, u)


def columns(path: Path) -> list[str]:
    """Names of a file's columns.

    Raises:
        ValueError: it cannot be read.
    """
    return _table(path)[0]


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Names of the columns, and the lines below."""
    text = "".join(line for line in _text(path).splitlines(keepends=True) if not line.startswith("#"))
    header, *lines = [row for row in csv.reader(io.StringIO(text)) if row] or [[]]
    return [name.strip() for name in header], lines


def _number(path: Path, line: int, row: Sequence[str], place: int) -> float:
    try:
        return float(row[place])
    except (ValueError, IndexError):
        told = row[place] if place < len(row) else ""
        raise ValueError(f"{path}: line {line} has {told!r} where a number must be") from None


def _looks_like_degrees(t: Array, angle: Array) -> str:
    """What of an angle cannot be if it is in radians; nothing where all can."""
    jumps = np.abs(np.diff(angle))
    if len(jumps) == 0 or not np.isfinite(angle).all() or (np.diff(t) <= 0.0).any():
        return ""
    if np.any(np.abs(jumps - COUNTS_A_TURN) < 10.0) and np.abs(angle).max() <= COUNTS_A_TURN:
        return f"jumps by {jumps.max():.0f}, as one does that wraps at 360"
    usual = float(np.percentile(jumps / np.diff(t), 90))
    if usual > MOST_SPEED:
        return f"changes by {usual:.0f} a second and more in a tenth of all samples"
    steps = np.unique(np.round(jumps[jumps > 0.0], 9))
    if len(steps) and steps[0] > 0.0:
        counts, turns = COUNTS_A_TURN / steps[0], 2.0 * math.pi / steps[0]
        if abs(counts - round(counts)) < 1e-4 * counts < abs(turns - round(turns)) and 100 < counts < 1e5:
            return f"comes in steps of {steps[0]:.4g}, {round(counts)} to 360"
    return ""


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read ({error})") from None
