"""A plant as an observer may know it: a compiled right-hand side and its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .kernels.cart_pendulum import plant
from .kernels.modelling import Rhs
from .plant import CartPendulum
from .typing import Array
from .validation import array, number, short


@dataclass(frozen=True, slots=True)
class Model:
    """``X' = rhs(X, s, (u, *params))`` for X = [q_1, q_2, q_1', q_2'], two positions and their velocities.

    ``rhs`` is a function of numbers and tuples that is marked :func:`smo_gym.kernels.inlined`; s, how much of an
    integration step has passed, is there to be ignored. u is in the unit that ``rhs`` takes: N, V, a share of full
    command. Two models of the same ``rhs`` share all compiled code.

    Args:
        rhs: the right-hand side.
        params: its numbers.
        names: of the positions, as tables say them.

    Raises:
        ValueError: a number is not finite, or ``rhs`` does not answer with four numbers.
    """

    rhs: Rhs
    params: tuple[float, ...] = ()
    names: tuple[str, str] = ("h", "theta")

    def __post_init__(self) -> None:
        object.__setattr__(self, "params", tuple(number(f"params[{i}]", p) for i, p in enumerate(self.params)))
        try:
            self.rate(np.zeros(4), 0.0)
        except Exception as error:  # whatever a user's function may raise
            told = f"{type(error).__name__}: {error}".splitlines()[0]
            raise ValueError(
                f"rhs={short(self.rhs)} must take (x, s, (u, {len(self.params)} params)) and give four numbers ({told})"
            ) from error

    @classmethod
    def of(cls, plant_: Model | CartPendulum) -> Model:
        """A model, or that of a cart pendulum, of whose friction it knows nothing.

        Raises:
            ValueError: it is neither.
        """
        if isinstance(plant_, Model):
            return plant_
        return cls(plant, tuple(CartPendulum.of(plant_, name="model").as_array().tolist()))

    def rate(self, x: ArrayLike, u: float) -> Array:
        """X' at one state, (4,)."""
        state = array("x", x, (4,)).tolist()
        return array("X'", self.rhs((state[0], state[1], state[2], state[3]), 0.0, (float(u), *self.params)), (4,))


def known(model: Any) -> Model | CartPendulum | None:
    """What an observer's setting ``model`` stands for: itself, a plant by its fields or numbers, or None.

    Raises:
        ValueError: it is none of these.
    """
    return model if model is None or isinstance(model, Model) else CartPendulum.of(model, name="model")
