"""Gains that ``smo-gym settle --search`` found on training plants: what the compensation is compared with."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from . import configs, reading
from .settings import Setting, Strict

Newtons = Annotated[float, Field(ge=0.0)]
Pair = tuple[Annotated[float, Field(ge=0.0)], Annotated[float, Field(ge=0.0)]]
Start = Literal["zero", "measured"]
STARTS: tuple[Start, ...] = ("zero", "measured")
"""The observer begins at xhat(0) = 0, or at [y(0), 0, 0]."""


class Matched(Strict):
    """Constant gains beta_1 + beta_2 c, as if |u| were always c newtons."""

    mean: Setting[Newtons]
    """c of equal time mean: the mean of |u| under compensation."""
    effort: Setting[Newtons]
    """c of equal effort: the loop's integral of u^2 is that under compensation, or as near to it as any c brings it."""


class Tuned(Strict):
    """What the same search found, with the same budget, over two numbers each."""

    beta_1: Setting[Pair]
    """Without any |u|."""
    beta_2: Setting[Pair]
    """Beside the printed beta_1."""


class Settled(Strict):
    """All that the comparison takes from training plants, by scenario, controller and start."""

    seed: Annotated[int, Field(ge=0)]
    """Of the training plants, and of the search."""
    plants: Annotated[int, Field(ge=1)]
    budget: Annotated[int, Field(ge=1)]
    """Evaluations of each search."""
    matched: dict[str, dict[str, dict[Start, Matched]]]
    tuned: dict[str, dict[str, dict[Start, Tuned]]]
    """On Table 4 and Table 7; what is found on the first is tried on Table 5, which no search has seen."""


def ours() -> Settled:
    """Those that come with the package."""
    return reading.read(configs.path("settle"), Settled)
