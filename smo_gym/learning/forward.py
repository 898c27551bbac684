"""The arithmetic of a frozen network, in one order of summation whatever the batch.

A matrix product of BLAS sums in an order that depends on the number of rows. Here entry after entry is multiplied and
added with one rounding, and only the loop over slots is vectorised: a slot's action is the same to the last bit alone
and among thousands.
"""

import numpy as np
from numpy.typing import NDArray

from ..kernels import kernel
from ..kernels.batch import LANES
from ..kernels.elementary import fma
from ..kernels.elementary import tanh as _tanh

Array = NDArray[np.float64]


def affine(W: Array, x: Array, b: Array) -> Array:
    """W x + b for inputs x (inputs, n) and b (outputs,) or (outputs, n): (outputs, n)."""
    y = np.empty((len(W), x.shape[1]))
    y[:] = b if b.ndim == 2 else b[:, None]
    _affine(np.ascontiguousarray(W), np.ascontiguousarray(x), y)
    return y


def tanh(x: Array) -> Array:
    """The hyperbolic tangent of every entry."""
    y = np.array(x, order="C")
    _squash(y.reshape(-1))
    return y


def sigmoid(x: Array) -> Array:
    """1 / (1 + exp(-x)) of every entry, as (1 + tanh(x / 2)) / 2."""
    return 0.5 + 0.5 * tanh(0.5 * x)


@kernel
def _affine(W: Array, x: Array, y: Array) -> None:
    """Add W x to y, in place, a block of slots at a time, which stays in the nearest cache."""
    outputs, inputs = W.shape
    n = x.shape[1]
    for first in range(0, n, LANES):
        lanes = min(LANES, n - first)
        for j in range(outputs):
            target = y[j, first : first + lanes]
            for i in range(inputs):
                w, source = W[j, i], x[i, first : first + lanes]
                for s in range(lanes):
                    target[s] = fma(w, source[s], target[s])


@kernel
def _squash(y: Array) -> None:
    for i in range(y.size):
        y[i] = _tanh(y[i])
