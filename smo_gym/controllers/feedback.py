"""What the feedback laws share: where an observation holds the estimate, and the checks of weights."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..loop import Loop, Part
from ..plant import CartPendulum
from ..typing import Array, Flags
from ..validation import array, number, observed, shape_of, short


def told(observation: ArrayLike) -> tuple[Array, Array]:
    """The estimate xhat and the reference x_d that an observation tells, each (..., 4); x_d = 0 where it tells none.

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
    xhat = seen[..., -4:]
    return xhat, np.zeros_like(xhat) if size == 6 else seen[..., 2:6]


class Feedback:
    """A law whose force is a block of xhat - x_d: what it needs besides is its :meth:`part`."""

    _alone: Loop | None = None

    def __setattr__(self, name: str, value: Any) -> None:
        """A law whose settings change is another one."""
        super().__setattr__(name, value)
        vars(self)["_alone"] = None if name != "_alone" else value

    @property
    def memory(self) -> int:
        """How many of its part's first rows are the law's own state."""
        return 0

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots.

        Raises:
            ValueError: it has gains for another number of slots.
        """
        raise NotImplementedError

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N, and the law's own state after it.

        Args:
            observation: (n, observation) or (observation,), from an observer wrapper.
            state: the law's own state, one array (n,) a number; None at the start.
            episode_start: slots whose state begins anew, shape (n,).
            deterministic: without effect: the law draws nothing.

        Returns:
            The force (n, 1), or (1,) for one observation, and the state for the next call.

        Raises:
            ValueError: the observation does not come from an observer wrapper, or is of another number of slots.
        """
        xhat, x_d = told(observation)
        single = xhat.ndim == 1
        n = 1 if single else len(xhat)
        loop, self._alone = self._alone, None  # nobody else has it meanwhile
        if loop is None or loop.n != n:
            loop = Loop(n, 0, {"law": self.part(n)})
        loop.xhat[:], loop.x_d[:] = np.atleast_2d(xhat).T, np.atleast_2d(x_d).T
        own = loop.own("law")
        loop.restart("law", slice(None))
        if self.memory:
            if state is not None:
                for i in range(self.memory):
                    own[i] = array(f"state[{i}]", state[i], (n,))
            if shape_of(episode_start) not in ((), (n,)):
                raise ValueError(f"episode_start={short(episode_start)} must hold {n} flags, one a slot")
            if episode_start is not None:
                begun = np.broadcast_to(np.asarray(episode_start, dtype=np.bool_), n)
                own[: self.memory, begun] = loop.initial("law")[: self.memory, begun]
        loop.run()
        after = tuple(row.copy() for row in own[: self.memory]) if self.memory else state
        u = loop.u[:, None].copy()
        self._alone = loop
        return (u[0] if single else u), after


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
