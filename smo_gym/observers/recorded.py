"""An observer along recorded positions, without an environment."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.batch import for_slots
from ..kernels.blocks import address
from ..kernels.replay import replay
from ..loop import Loop, Part
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import short
from .protocol import Compiled

_JITTER = 1e-6
"""Periods that differ by less than this share from their median are taken as that: stamps are rounded numbers."""

_MICROSECONDS_A_SAMPLE = 0.05  # of one slot: decides when a second thread is worth waking


def periods(t: Array) -> tuple[float, Array]:
    """The sampling period, as the median to nine digits, and the time since the sample before at each, (samples,)."""
    h = np.diff(t)
    dt = float(f"{np.median(h):.9g}")
    return dt, np.r_[dt, np.where(np.abs(h - dt) < _JITTER * dt, dt, h)]


def run(
    observer: Compiled,
    t: ArrayLike,
    y: ArrayLike,
    u: ArrayLike,
    model: Model | CartPendulum | None = None,
    force: float | None = None,
) -> Array:
    """Estimates [q_1, q_2, q_1', q_2'] at each sample of a recording, (samples, 4).

    The one at sample k knows y_0 to y_k and u_0 to u_{k-1}: u_k acts from t_k to t_{k+1}. Samples may be missing or
    uneven; each recording of several is a call of its own.

    Args:
        observer: one that is compiled.
        t: times in s, (samples,), which grow.
        y: measured positions, (samples, 2), the second unwrapped where it turns.
        u: input, (samples,), in the model's unit.
        model: what the observer knows of the plant where its own settings do not say; Table 2's by default.
        force: bound of |u|; the largest of the recording by default.

    Raises:
        ValueError: shapes that do not fit, fewer than two samples, a number that is not finite, time that does not
            grow, or an observer that cannot work with this sampling period and input.
    """
    times, positions, inputs = checked(t, y, u)
    dt, h = periods(times)
    largest = float(np.abs(inputs).max()) if force is None else force
    part = observer.part(1, dt, largest, model or CartPendulum())
    return along(part, h, positions[:, :, None], inputs[:, None])[:, :, 0]


def along(part: Part, h: Array, y: Array, u: Array) -> Array:
    """Estimates of n slots along recordings of as many samples, (samples, 4, n).

    Args:
        part: what the observer puts into a loop of n slots.
        h: time since the sample before in s, (samples,).
        y: measured positions, (samples, 2, n).
        u: input from each sample to the next, (samples, n).
    """
    n = y.shape[2]
    loop = Loop(n, 1, {"observer": part})
    loop.start(slice(None), np.concatenate([y[0], np.zeros((2, n))]))
    xhat = np.empty((len(y), 4, n))
    xhat[0] = loop.xhat
    if part.sample is None:
        xhat[1:] = loop.xhat
        return xhat
    place, period = loop.place("observer"), -1 if part.period is None else part.period
    whole = loop.rows, address(part.sample), place.start, place.stop, period
    for_slots(replay, 0, n, _MICROSECONDS_A_SAMPLE * len(y), *whole, h, y, u[:, None], xhat)
    return xhat


def checked(t: ArrayLike, y: ArrayLike, u: ArrayLike) -> tuple[Array, Array, Array]:
    """Arrays of a recording.

    Raises:
        ValueError: as of :func:`run`.
    """
    times, positions, inputs = (np.ascontiguousarray(each, dtype=np.float64) for each in (t, y, u))
    n = len(times) if times.ndim == 1 else 0
    if n < 2:
        raise ValueError(f"t={short(t)} must be the times of two samples or more, shape (samples,)")
    for name, values, shape in (("y", positions, (n, 2)), ("u", inputs, (n,))):
        if values.shape != shape:
            raise ValueError(f"{name} has shape {values.shape}, it must have shape {shape}: t has {n} samples")
    for name, values in (("t", times), ("y", positions), ("u", inputs)):
        if not np.isfinite(values).all():
            k = int(np.argmin(np.isfinite(values.reshape(n, -1)).all(1)))
            raise ValueError(f"{name}[{k}]={values[k].tolist()} must be finite; leave out a sample that is missing")
    if (np.diff(times) <= 0.0).any():
        k = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise ValueError(
            f"t[{k}]={times[k]!r} must be later than t[{k - 1}]={times[k - 1]!r}: each recording is a call of its own"
        )
    return times, positions, inputs
