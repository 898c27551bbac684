"""Linear quadratic regulator on the estimated state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_continuous_are

from ..plant import CartPendulum
from ..validation import array
from .feedback import estimated_error, weights

Array = NDArray[np.float64]


class LQR:
    """u = -K xhat, or u = -K (xhat - x_d) where there is a reference to track.

    Args:
        K: gain in N/m, N/rad, N s/m, N s/rad, shape (4,); or (n, 4), one a slot.

    Raises:
        ValueError: K has another shape or is not finite.
    """

    def __init__(self, K: ArrayLike) -> None:
        shape = np.shape(K)
        if shape[-1:] != (4,) or len(shape) > 2:
            raise ValueError(f"K has shape {shape}, it must have shape (4,) or (n, 4)")
        self.K = np.atleast_2d(array("K", K, shape))

    @classmethod
    def design(cls, Q: ArrayLike, R: float, model: CartPendulum | None = None) -> LQR:
        """The gain that minimises the integral of ``x' Q x + R u^2`` for the model linearised about x = 0.

        ``K = B' P / R`` with P from the algebraic Riccati equation ``A' P + P A - P B B' P / R + Q = 0``.

        Args:
            Q: weights, the diagonal (4,) or a symmetric positive semidefinite (4, 4).
            R: weight of the force, positive.
            model: nominal plant (Table 2 by default).

        Raises:
            ValueError: a weight is not allowed.
        """
        A, B = (model or CartPendulum()).linearise()
        Q, R = weights(Q, R)
        P = solve_continuous_are(A, B, Q, np.array([[R]]))
        return cls((B.T @ P)[0] / R)

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N, shape (n, 1) for observations (n, observation) and (1,) for one; the law has no state.

        Raises:
            ValueError: the observation does not come from an observer wrapper, or K has another number of slots.
        """
        e = estimated_error(observation)
        if len(self.K) > 1 and e.shape[:-1] != (len(self.K),):
            raise ValueError(f"K has {len(self.K)} slots, the observation has shape {np.shape(observation)}")
        # one order of summation for every batch size, which a matrix product does not promise
        K = self.K
        u = -(K[:, 0] * e[..., 0] + K[:, 1] * e[..., 1] + K[:, 2] * e[..., 2] + K[:, 3] * e[..., 3])
        return (u[:, None] if observation.ndim == 2 else u), state

    def __repr__(self) -> str:
        return f"LQR(K={self.K.squeeze().tolist()})"
