"""Linear quadratic regulator on the estimated state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_continuous_are

from ..plant import CartPendulum
from .feedback import estimates, weights

Array = NDArray[np.float64]


class LQR:
    """u = -K xhat.

    Args:
        K: gain in N/m, N/rad, N s/m, N s/rad, shape (4,); or (n, 4), one a slot.

    Raises:
        ValueError: K has another shape or is not finite.
    """

    def __init__(self, K: ArrayLike) -> None:
        self.K = np.atleast_2d(np.array(K, dtype=np.float64))
        if self.K.ndim != 2 or self.K.shape[1] != 4 or not np.isfinite(self.K).all():
            raise ValueError(f"K={K!r} must be finite and of shape (4,) or (n, 4)")

    @classmethod
    def design(cls, Q: ArrayLike, R: float, model: CartPendulum | None = None, theta: float = 0.0) -> LQR:
        """The gain that minimises the integral of ``x' Q x + R u^2`` for the model linearised about ``theta``.

        ``K = B' P / R`` with P from the algebraic Riccati equation ``A' P + P A - P B B' P / R + Q = 0``.

        Args:
            Q: weights, the diagonal (4,) or a symmetric positive semidefinite (4, 4).
            R: weight of the force, positive.
            model: nominal plant (Table 2 by default).
            theta: equilibrium, 0 or pi.

        Raises:
            ValueError: a weight is not allowed.
        """
        A, B = (model or CartPendulum()).linearise(theta)
        Q, R = weights(Q, R)
        P = solve_continuous_are(A, B, Q, np.array([[R]]))
        return cls((B.T @ P)[0] / R)

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N, shape (n, 1) for observations (n, 6) and (1,) for one (6,); the law has no state.

        Raises:
            ValueError: the observation does not end in the four entries of xhat.
        """
        xhat = estimates(observation)
        # one order of summation for every batch size, which a matrix product does not promise
        K = self.K
        u = -(K[:, 0] * xhat[..., 0] + K[:, 1] * xhat[..., 1] + K[:, 2] * xhat[..., 2] + K[:, 3] * xhat[..., 3])
        return (u[:, None] if observation.ndim == 2 else u), state

    def __repr__(self) -> str:
        return f"LQR(K={self.K.squeeze().tolist()})"
