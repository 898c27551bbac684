"""Linear quadratic regulator on the estimated state."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import ArrayLike

from ..kernels.blocks import U, at, block, error, four, offsets, put
from ..loop import Part, columns
from ..typing import Array
from ..validation import array, shape_of, short, switch
from .feedback import Feedback, nominal, weights

_SLOWEST = 1e-6  # of the fastest pole's size: nearer to the axis a pole is on it, but for rounding


GAIN, WRAP, _ = offsets(4, 1)


@block
def _act(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        K, e = four(own, GAIN, i), error(signals, i, at(own, WRAP, i))
        put(signals, U, i, -(K[0] * e[0] + K[1] * e[1] + K[2] * e[2] + K[3] * e[3]))


class LQR(Feedback):
    """u = -K xhat, or u = -K (xhat - x_d) where there is a reference to track.

    Args:
        K: gain in N/m, N/rad, N s/m, N s/rad, shape (4,); or (n, 4), one a slot.
        wrap: take the error of the angle within half a turn, so that a rod that has turned may rest where it is; the
            article's scenarios do without.

    Raises:
        ValueError: K has another shape or is not finite.
    """

    def __init__(self, K: ArrayLike, wrap: bool = True) -> None:
        shape = shape_of(K)
        if shape is None or shape[-1:] != (4,) or len(shape) > 2:
            raise ValueError(f"K has shape {shape}, it must have shape (4,) or (n, 4)")
        self.K = np.atleast_2d(array("K", K, shape))
        self.K.flags.writeable = False
        self.wrap = switch("wrap", wrap)

    @classmethod
    def design(cls, Q: ArrayLike, R: ArrayLike, model: Any = None, wrap: bool = True) -> LQR:
        """The gain that minimises the integral of ``x' Q x + R u^2`` for the model linearised about x = 0.

        ``K = B' P / R`` with P from the algebraic Riccati equation ``A' P + P A - P B B' P / R + Q = 0``.

        Args:
            Q: weights, the diagonal (4,) or a symmetric positive semidefinite (4, 4).
            R: weight of the force, positive; a number or an array of shape (1, 1).
            model: nominal plant, or an environment, whose nominal plant is taken (Table 2 by default).
            wrap: take the error of the angle within half a turn.

        Raises:
            ValueError: a weight is not allowed, or under these weights no gain makes x = 0 asymptotically stable.
        """
        from scipy.linalg import solve_continuous_are  # takes a while, and only designing needs it

        A, B = nominal(model).linearise()
        weight, r = weights(Q, R)
        try:
            P = solve_continuous_are(A, B, weight, np.array([[r]]))
            K = (B.T @ P)[0] / r
            poles = np.linalg.eigvals(A - B @ K[None])
        except (LinAlgError, ValueError):  # SciPy found no stabilising solution
            poles = np.array([np.nan])
        if not poles.real.max() < -_SLOWEST * np.abs(poles).max():
            raise ValueError(
                f"Q={short(Q)} leaves x = 0 without asymptotic stability (largest real part of a closed-loop pole "
                f"{poles.real.max():.1e} 1/s): give every motion a weight, h above all, as Q = [1, 1, 0, 0] does"
            )
        return cls(K, wrap)

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots.

        Raises:
            ValueError: K has another number of slots.
        """
        if len(self.K) not in (1, n):
            raise ValueError(f"K has {len(self.K)} slots, the observation has {n}")
        return Part(columns(n, self.K.T, float(self.wrap)), act=_act)

    def __repr__(self) -> str:
        return f"LQR(K={self.K.squeeze().tolist()})"
