"""Covariances of a state of four: ten numbers, the rows of the upper triangle one after the other."""

import math

from ..typing import Array, State
from . import inlined
from .batch import LANES
from .elementary import fma

Matrix = tuple[State, State, State, State]
Symmetric = tuple[float, float, float, float, float, float, float, float, float, float]


@inlined
def dot(a: State, b: State) -> float:
    """The inner product."""
    return fma(a[3], b[3], fma(a[2], b[2], fma(a[1], b[1], a[0] * b[0])))


@inlined
def times(a: State, P: Symmetric) -> State:
    """``a P``, a row."""
    return (
        dot(a, (P[0], P[1], P[2], P[3])),
        dot(a, (P[1], P[4], P[5], P[6])),
        dot(a, (P[2], P[5], P[7], P[8])),
        dot(a, (P[3], P[6], P[8], P[9])),
    )


@inlined
def congruent(F: Matrix, P: Symmetric) -> Symmetric:
    """``F P F'``."""
    a, b, c, d = F
    pa, pb, pc, pd = times(a, P), times(b, P), times(c, P), times(d, P)
    return (
        dot(pa, a),
        dot(pa, b),
        dot(pa, c),
        dot(pa, d),
        dot(pb, b),
        dot(pb, c),
        dot(pb, d),
        dot(pc, c),
        dot(pc, d),
        dot(pd, d),
    )


@inlined
def plus_square(P: Symmetric, w: float, a: State) -> Symmetric:
    """``P + w a' a``."""
    wa, wb, wc, wd = w * a[0], w * a[1], w * a[2], w * a[3]
    return (
        fma(wa, a[0], P[0]),
        fma(wa, a[1], P[1]),
        fma(wa, a[2], P[2]),
        fma(wa, a[3], P[3]),
        fma(wb, a[1], P[4]),
        fma(wb, a[2], P[5]),
        fma(wb, a[3], P[6]),
        fma(wc, a[2], P[7]),
        fma(wc, a[3], P[8]),
        fma(wd, a[3], P[9]),
    )


@inlined
def plus(P: Symmetric, Q: Symmetric) -> Symmetric:
    """``P + Q``."""
    return (
        P[0] + Q[0],
        P[1] + Q[1],
        P[2] + Q[2],
        P[3] + Q[3],
        P[4] + Q[4],
        P[5] + Q[5],
        P[6] + Q[6],
        P[7] + Q[7],
        P[8] + Q[8],
        P[9] + Q[9],
    )


@inlined
def symmetric(rows: Array, row: int, i: int) -> Symmetric:
    """Ten rows' numbers in lane i. By way of :func:`four` their offsets would be known too late to vectorise."""
    return (
        rows[row * LANES + i],
        rows[(row + 1) * LANES + i],
        rows[(row + 2) * LANES + i],
        rows[(row + 3) * LANES + i],
        rows[(row + 4) * LANES + i],
        rows[(row + 5) * LANES + i],
        rows[(row + 6) * LANES + i],
        rows[(row + 7) * LANES + i],
        rows[(row + 8) * LANES + i],
        rows[(row + 9) * LANES + i],
    )


@inlined
def put_symmetric(rows: Array, row: int, i: int, P: Symmetric) -> None:
    """Set ten rows' numbers in lane i."""
    rows[row * LANES + i] = P[0]
    rows[(row + 1) * LANES + i] = P[1]
    rows[(row + 2) * LANES + i] = P[2]
    rows[(row + 3) * LANES + i] = P[3]
    rows[(row + 4) * LANES + i] = P[4]
    rows[(row + 5) * LANES + i] = P[5]
    rows[(row + 6) * LANES + i] = P[6]
    rows[(row + 7) * LANES + i] = P[7]
    rows[(row + 8) * LANES + i] = P[8]
    rows[(row + 9) * LANES + i] = P[9]


def diagonal(a: float, b: float, c: float, d: float) -> Symmetric:
    """A covariance of numbers that have nothing to do with each other."""
    return a, 0.0, 0.0, 0.0, b, 0.0, 0.0, c, 0.0, d


@inlined
def cholesky(P: Symmetric, scale: float) -> Matrix:
    """Columns of the lower triangular L with ``L L' = scale P``."""
    a = math.sqrt(scale * P[0])
    w = scale / a
    b, c, d = w * P[1], w * P[2], w * P[3]
    e = math.sqrt(scale * P[4] - b * b)
    f, g = (scale * P[5] - b * c) / e, (scale * P[6] - b * d) / e
    h = math.sqrt(scale * P[7] - c * c - f * f)
    j = (scale * P[8] - c * d - f * g) / h
    k = math.sqrt(scale * P[9] - d * d - g * g - j * j)
    return (a, b, c, d), (0.0, e, f, g), (0.0, 0.0, h, j), (0.0, 0.0, 0.0, k)


@inlined
def corrected(x: State, P: Symmetric, column: State, e: float, s: float) -> tuple[State, Symmetric]:
    """State and covariance after a measured position: its column of P, its innovation e and the variance s of that."""
    inverse = 1.0 / s
    k = inverse * e
    new = x[0] + k * column[0], x[1] + k * column[1], x[2] + k * column[2], x[3] + k * column[3]
    return new, plus_square(P, -inverse, column)
