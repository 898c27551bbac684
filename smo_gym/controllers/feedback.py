"""What the feedback laws share: where an observation holds the estimate, and the checks of weights."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..validation import array, number

Array = NDArray[np.float64]


def estimated_error(observation: Array) -> Array:
    """What a law should bring to zero, (..., 4): xhat, or xhat - x_d where the observation tells x_d.

    The observation is [h, theta, xhat (4)], or with a reference [h, theta, x_d (4), preview (4 each), xhat (4)].

    An unobserved tracking environment cannot be told from an observed one by its size: wrap it.

    Raises:
        ValueError: the observation cannot come from an observer wrapper.
    """
    size = observation.shape[-1]
    if size < 6 or (size - 2) % 4:
        raise ValueError(
            f"observation has shape {observation.shape}, it must begin with [h, theta] and end with xhat (4): "
            "wrap the environment in smo_gym.ObserverWrapper or smo_gym.VectorObserverWrapper"
        )
    xhat = observation[..., -4:]
    return xhat if size == 6 else xhat - observation[..., 2:6]


def weights(Q: ArrayLike, R: float) -> tuple[Array, float]:
    """Q as a (4, 4) matrix and R as a float.

    Raises:
        ValueError: Q is not symmetric positive semidefinite of shape (4,) or (4, 4), or R is not positive.
    """
    matrix = array("Q", Q, np.shape(Q))
    matrix = np.diag(matrix) if matrix.shape == (4,) else matrix
    if (
        matrix.shape != (4, 4)
        or not np.allclose(matrix, matrix.T)
        or np.linalg.eigvalsh(matrix).min() < -1e-12 * max(1.0, np.abs(matrix).max())
    ):
        raise ValueError(f"Q={Q!r} must be symmetric positive semidefinite, given as its diagonal (4,) or as (4, 4)")
    return matrix, number("R", R, above=0.0)
