"""The arithmetic of a frozen network, in one order of summation whatever the batch.

A matrix product of BLAS sums in an order that depends on the number of rows. Here entry after entry is multiplied and
added with one rounding, and only the loop over slots is vectorised: a slot's action is the same to the last bit alone
and among thousands.
"""

import numpy as np

from ..kernels import inlined, kernel
from ..kernels.batch import LANES
from ..kernels.elementary import fma, tanh
from ..typing import Array

FEW = 2
"""Up to so many slots the loop over them is not worth vectors: outputs are summed side by side instead."""


def affine(W: Array, x: Array, b: Array) -> Array:
    """W x + b for inputs x (inputs, n) and b (outputs,) or (outputs, n): (outputs, n)."""
    y = np.empty((len(W), x.shape[1]))
    y[:] = b if b.ndim == 2 else b[:, None]
    (_affine_few if x.shape[1] <= FEW else _affine)(np.ascontiguousarray(W), np.ascontiguousarray(x), y)
    return y


def dense(W: Array, x: Array, b: Array) -> Array:
    """tanh(W x + b) for inputs x (inputs, n) and b (outputs,) or (outputs, n): (outputs, n)."""
    y = affine(W, x, b)
    _squash(y.reshape(-1))
    return y


def lstm(gates: Array, c: Array) -> tuple[Array, Array]:
    """The LSTM's next h and c, (m, n), from the sums at its gates i, f, g, o (4 m, n) and c (m, n).

    ::

        c <- sigma(f) c + sigma(i) tanh(g),   h <- sigma(o) tanh(c)
    """
    h, after = np.empty_like(gates[: len(c)]), np.array(c, order="C")
    _lstm(gates.reshape(-1), h.reshape(-1), after.reshape(-1))
    return h, after


@kernel
def _affine(W: Array, x: Array, y: Array) -> None:
    """Add W x to y, in place: a block of slots, two outputs and four inputs at a time, which loads each number once."""
    outputs, inputs = W.shape
    n = x.shape[1]
    fours = inputs - inputs % 4
    here, sums = np.empty((inputs, LANES)), np.empty((2, LANES))  # rows of x may be a power of two apart
    for first in range(0, n, LANES):
        lanes = min(LANES, n - first)
        for i in range(inputs):
            for s in range(lanes):
                here[i, s] = x[i, first + s]
        for j in range(0, outputs, 2):
            k = min(j + 1, outputs - 1)  # the last of an odd number is summed twice
            p, q = sums[0], sums[1]
            for s in range(lanes):
                p[s], q[s] = y[j, first + s], y[k, first + s]
            for i in range(0, fours, 4):
                v0, v1, v2, v3 = W[j, i], W[j, i + 1], W[j, i + 2], W[j, i + 3]
                w0, w1, w2, w3 = W[k, i], W[k, i + 1], W[k, i + 2], W[k, i + 3]
                x0, x1, x2, x3 = here[i], here[i + 1], here[i + 2], here[i + 3]
                for s in range(lanes):
                    p[s] = fma(v3, x3[s], fma(v2, x2[s], fma(v1, x1[s], fma(v0, x0[s], p[s]))))
                    q[s] = fma(w3, x3[s], fma(w2, x2[s], fma(w1, x1[s], fma(w0, x0[s], q[s]))))
            for i in range(fours, inputs):
                v, w, x0 = W[j, i], W[k, i], here[i]
                for s in range(lanes):
                    p[s] = fma(v, x0[s], p[s])
                    q[s] = fma(w, x0[s], q[s])
            for s in range(lanes):
                y[j, first + s], y[k, first + s] = p[s], q[s]


@kernel
def _affine_few(W: Array, x: Array, y: Array) -> None:
    """Add W x to y, in place, for few slots: four outputs at a time, which do not wait for each other."""
    outputs, inputs = W.shape
    fours = outputs - outputs % 4
    for s in range(x.shape[1]):
        for j in range(0, fours, 4):
            a, b, c, d = y[j, s], y[j + 1, s], y[j + 2, s], y[j + 3, s]
            for i in range(inputs):
                v = x[i, s]
                a, b, c, d = fma(W[j, i], v, a), fma(W[j + 1, i], v, b), fma(W[j + 2, i], v, c), fma(W[j + 3, i], v, d)
            y[j, s], y[j + 1, s], y[j + 2, s], y[j + 3, s] = a, b, c, d
        for j in range(fours, outputs):
            a = y[j, s]
            for i in range(inputs):
                a = fma(W[j, i], x[i, s], a)
            y[j, s] = a


@kernel
def _squash(y: Array) -> None:
    for i in range(y.size):
        y[i] = tanh(y[i])


@inlined
def _sigmoid(x: float) -> float:
    return 0.5 + 0.5 * tanh(0.5 * x)


@kernel
def _lstm(gates: Array, h: Array, c: Array) -> None:
    size = c.size
    i, f, g, o = gates[:size], gates[size : 2 * size], gates[2 * size : 3 * size], gates[3 * size :]
    for k in range(size):
        c[k] = _sigmoid(f[k]) * c[k] + _sigmoid(i[k]) * tanh(g[k])
        h[k] = _sigmoid(o[k]) * tanh(c[k])
