"""What the feedback laws share: where an observation holds the estimate, and the checks of weights."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..validation import number

Array = NDArray[np.float64]


def estimates(observation: Array) -> Array:
    """xhat, the last four entries of observations (..., 6) from an observer wrapper.

    Raises:
        ValueError: the observation has another size: it comes from an environment without an observer.
    """
    if observation.shape[-1] != 6:
        raise ValueError(
            f"observation has shape {observation.shape}, its last axis must be [h, theta, xhat (4)]: "
            "wrap the environment in smo_gym.ObserverWrapper or smo_gym.VectorObserverWrapper"
        )
    return observation[..., 2:]


def weights(Q: ArrayLike, R: float) -> tuple[Array, float]:
    """Q as a (4, 4) matrix and R as a float.

    Raises:
        ValueError: Q is not symmetric positive semidefinite of shape (4,) or (4, 4), or R is not positive.
    """
    matrix = np.array(Q, dtype=np.float64)
    matrix = np.diag(matrix) if matrix.shape == (4,) else matrix
    if (
        matrix.shape != (4, 4)
        or not np.isfinite(matrix).all()
        or not np.allclose(matrix, matrix.T)
        or np.linalg.eigvalsh(matrix).min() < -1e-12 * max(1.0, np.abs(matrix).max())
    ):
        raise ValueError(f"Q={Q!r} must be symmetric positive semidefinite, given as its diagonal (4,) or as (4, 4)")
    return matrix, number("R", R, above=0.0)
