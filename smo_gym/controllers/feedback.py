"""What the feedback laws share: where an observation holds the estimate, and the checks of weights."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..plant import CartPendulum
from ..typing import Array
from ..validation import array, number, observed, shape_of, short


def estimated_error(observation: ArrayLike, wrap: bool) -> Array:
    """What a law should bring to zero, (..., 4): xhat, or xhat - x_d where the observation tells x_d.

    With ``wrap`` the error of the angle is the one within half a turn: an encoder goes on counting, and a rod that has
    turned is where it was.

    The observation is [h, theta, xhat (4)], or with a reference [h, theta, x_d (4), preview (4 each), xhat (4)].

    An unobserved tracking environment cannot be told from an observed one by its size: wrap it.

    Raises:
        ValueError: the observation cannot come from an observer wrapper.
    """
    seen = observed(observation)
    size = seen.shape[-1]
    if size < 6 or (size - 2) % 4:
        raise ValueError(
            f"observation has shape {seen.shape}, it must begin with [h, theta] and end with xhat (4): "
            "wrap the environment in smo_gym.ObserverWrapper or smo_gym.VectorObserverWrapper"
        )
    error = seen[..., -4:] if size == 6 else seen[..., -4:] - seen[..., 2:6]
    if not wrap:
        return error
    turns = np.zeros_like(error)
    turns[..., 1] = np.rint(error[..., 1] / (2.0 * np.pi))
    return np.asarray(error - 2.0 * np.pi * turns)


def nominal(model: Any) -> CartPendulum:
    """The plant that a law is designed for: a plant, what :meth:`CartPendulum.of` takes, or an environment's.

    Raises:
        ValueError: it is none of these.
    """
    task = getattr(getattr(model, "unwrapped", None), "task", None)
    if isinstance(params := getattr(task, "params", None), CartPendulum):
        return params
    if isinstance(model, str) or not isinstance(model, CartPendulum | Mapping | Sequence | np.ndarray | None):
        raise ValueError(f"model={short(model)} must be a CartPendulum or a smo_gym environment")
    return CartPendulum.of(model, name="model")


def weights(Q: ArrayLike, R: ArrayLike) -> tuple[Array, float]:
    """Q as a (4, 4) matrix and R as a float.

    Raises:
        ValueError: Q is not symmetric positive semidefinite of shape (4,) or (4, 4), or R, a number or (1, 1), is not
            positive.
    """
    shape = shape_of(Q)
    matrix = array("Q", Q, (4, 4) if shape == (4, 4) else (4,))
    matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() < -1e-12 * max(1.0, np.abs(matrix).max()):
        raise ValueError(
            f"Q={short(Q)} must be symmetric positive semidefinite, given as its diagonal (4,) or as (4, 4)"
        )
    if shape_of(R) not in ((), (1,), (1, 1)):
        raise ValueError(f"R={short(R)} must be a positive number, or that as an array of shape (1, 1)")
    return matrix, number("R", np.asarray(R).item() if np.ndim(R) else R, above=0.0)
