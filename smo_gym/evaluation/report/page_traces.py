"""Traces in little space, for a page that unpacks them with the inflate that every browser has.

A run is eleven channels: x, x - xhat, the least and the largest force since the instant before, and the mean force;
where any sensor is not exact two more, y - [h, theta]. A channel is stored as whole numbers between its own least and
largest value, as differences from one instant to the next; all low bytes come before all high bytes, which deflate
packs better.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...plant import STATE_NAMES
from ...typing import Array
from ..study import Outcome
from .panels import smooth, traced

CHANNELS = (*STATE_NAMES, *(f"error_{name}" for name in STATE_NAMES), "force_low", "force_high", "force")
SENSED = ("sensor_h", "sensor_theta")
"""Channels of what was measured less what was true."""
LEVELS = np.array([2**14 - 1] * 8 + [2**10 - 1] * 3 + [2**14 - 1] * 2)
"""Steps of a channel between its least and largest value: what a plot shows, enlarged some times."""
MOST_VALUES = 4_000_000
"""Most values in a page; so many take about 5 MB."""
_LARGEST = 1e4  # an estimate that has diverged


def channels(outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Those that the runs of a page have."""
    return (*CHANNELS, *SENSED) if any(traced(outcome).y is not None for outcome in outcomes) else CHANNELS


def runs_that_fit(outcomes: Sequence[Outcome]) -> int:
    """How many runs of each group keep a page small; at least one."""
    shapes: list[tuple[int, int]] = [traced(outcome).u.shape for outcome in outcomes]  # instants, runs

    def total(runs: int) -> int:
        return len(channels(outcomes)) * sum(instants * min(count, runs) for instants, count in shapes)

    most = max(count for _, count in shapes)
    return next((runs for runs in range(most, 1, -1) if total(runs) <= MOST_VALUES), 1)


def pack(outcomes: Sequence[Outcome], runs: int) -> tuple[list[dict[str, int | None]], str]:
    """The first runs of some groups.

    Returns:
        Of each group how many instants and runs it has, which block is its first and which its reference's; and the
        blocks of all in base64: least and largest values in float32, then low bytes, then high bytes, deflated.
    """
    places: list[dict[str, int | None]] = []
    blocks: list[Array] = []
    sensed = len(channels(outcomes)) - len(CHANNELS)
    for outcome in outcomes:
        traces = traced(outcome)
        first = len(blocks)
        shown = min(runs, traces.u.shape[1])
        mean = smooth(traces.time, traces.u_mean)
        off = np.zeros((len(traces.time), sensed, shown))
        if traces.y is not None:
            off = (traces.y - traces.x[:, :2])[:, :, :shown]
        for r in range(shown):
            forces = np.array([traces.u_low[:, r], traces.u_high[:, r], mean[:, r]])
            block = np.concatenate([traces.x[:, :, r].T, (traces.x - traces.xhat)[:, :, r].T, forces, off[:, :, r].T])
            last = np.searchsorted(traces.time, outcome.metrics["duration"][r] + 1e-9, side="right") - 1
            blocks.append(block[:, np.minimum(np.arange(len(traces.time)), last)])  # held after a failure
        if traces.x_d is not None:
            blocks.append(np.concatenate([traces.x_d.T, np.zeros((len(CHANNELS) + sensed - 4, len(traces.time)))]))
        reference = None if traces.x_d is None else first + shown
        places.append({"samples": len(traces.time), "runs": shown, "first": first, "reference": reference})
    coded = [_code(block) for block in blocks]
    ranges = np.concatenate([limits for limits, _ in coded]).astype("<f4").tobytes()
    steps = np.concatenate([steps.ravel() for _, steps in coded]).astype("<i2").view(np.uint8)
    data = zlib.compress(ranges + steps[0::2].tobytes() + steps[1::2].tobytes(), 6)
    return places, base64.b64encode(data).decode("ascii")


def _code(block: Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Least and largest value of each channel, and its differences in steps between them."""
    block = np.clip(np.nan_to_num(block, nan=_LARGEST), -_LARGEST, _LARGEST)
    limits = np.stack([block.min(axis=1), block.max(axis=1)], axis=1).astype(np.float32)
    low, span = limits[:, :1].astype(np.float64), np.diff(limits.astype(np.float64), axis=1)
    levels = LEVELS[: len(block), None]
    whole = np.rint((block - low) / np.where(span > 0.0, span, 1.0) * levels)
    return limits, np.diff(np.clip(whole, 0, levels).astype(np.int64), axis=1, prepend=0)
