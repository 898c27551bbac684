"""A model near a state: what a small error becomes over a step, and what acceleration noise adds to it."""

from typing import Any

from ..typing import State
from . import inlined
from .matrices import Matrix, Symmetric
from .modelling import Rhs

# Of central differences: a power of two, so that adding it to numbers of order 1 rounds nothing away.
_STEP = 2.0**-17
_INVERSE = 0.5 / _STEP


@inlined
def _slope(rhs: Rhs, x: State, d: State, u: float, du: float, p: Any) -> tuple[float, float]:
    """How fast both accelerations grow from (x, u) along (d, du)."""
    above = (x[0] + d[0], x[1] + d[1], x[2] + d[2], x[3] + d[3])
    below = (x[0] - d[0], x[1] - d[1], x[2] - d[2], x[3] - d[3])
    a, b = rhs(above, 0.5, (u + du,) + p), rhs(below, 0.5, (u - du,) + p)  # noqa: RUF005  # Numba unpacks no tuple here
    return _INVERSE * (a[2] - b[2]), _INVERSE * (a[3] - b[3])


@inlined
def jacobian(rhs: Rhs, x: State, u: float, p: Any) -> tuple[State, State]:
    """Rows 3 and 4 of A = d rhs / dx for a model's numbers p; its first two are [0 0 1 0] and [0 0 0 1]."""
    a = _slope(rhs, x, (_STEP, 0.0, 0.0, 0.0), u, 0.0, p)
    b = _slope(rhs, x, (0.0, _STEP, 0.0, 0.0), u, 0.0, p)
    c = _slope(rhs, x, (0.0, 0.0, _STEP, 0.0), u, 0.0, p)
    d = _slope(rhs, x, (0.0, 0.0, 0.0, _STEP), u, 0.0, p)
    return (a[0], b[0], c[0], d[0]), (a[1], b[1], c[1], d[1])


@inlined
def ratio(rhs: Rhs, x: State, u: float, p: Any) -> float:
    """By how much the input accelerates the second coordinate where it accelerates the first by 1.

    0 where it does not accelerate the first.
    """
    first, second = _slope(rhs, x, (0.0, 0.0, 0.0, 0.0), u, _STEP, p)
    return second / first if first != 0.0 else 0.0


@inlined
def transition(A: tuple[State, State], h: float) -> Matrix:
    """``I + A h + A^2 h^2 / 2`` from rows 3 and 4 of A."""
    (a0, a1, a2, a3), (b0, b1, b2, b3) = A
    s = 0.5 * h * h
    return (
        (1.0 + s * a0, s * a1, h + s * a2, s * a3),
        (s * b0, 1.0 + s * b1, s * b2, h + s * b3),
        (
            h * a0 + s * (a2 * a0 + a3 * b0),
            h * a1 + s * (a2 * a1 + a3 * b1),
            1.0 + h * a2 + s * (a0 + a2 * a2 + a3 * b2),
            h * a3 + s * (a1 + a2 * a3 + a3 * b3),
        ),
        (
            h * b0 + s * (b2 * a0 + b3 * b0),
            h * b1 + s * (b2 * a1 + b3 * b1),
            h * b2 + s * (b0 + b2 * a2 + b3 * b2),
            1.0 + h * b3 + s * (b1 + b2 * a3 + b3 * b3),
        ),
    )


@inlined
def process_noise(density: tuple[float, float], r: float, h: float) -> Symmetric:
    """Covariance that white noise of the accelerations adds to two double integrators over h.

    That of the first, of power spectral density ``density[0]``, acts along the input: it moves the second r times as
    much. ``density[1]`` is of what acts on the second alone.
    """
    a, b = density[0], r * density[0]
    c = r * b + density[1]
    i, j = 0.5 * h * h, h * h * h / 3.0
    return j * a, j * b, i * a, i * b, j * c, i * b, i * c, h * a, h * b, h * c


@inlined
def halfway(a: State, b: State) -> State:
    """The mean of two states."""
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]), 0.5 * (a[3] + b[3])
