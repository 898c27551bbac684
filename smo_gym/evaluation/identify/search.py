"""What the article leaves unprinted, recovered from its cells by CMA-ES; :mod:`.unprinted` says from which."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...typing import Array
from ...validation import array


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What is taken for granted while the parameters are searched; None is as in ``configs/``."""

    name: str = "as in configs/"
    gravity: float = -9.8
    horizon: float | None = None
    """Length of the runs in s."""
    estimate_starts_at_truth: bool = False
    time_constant: float = 0.0
    """Time constant of the observer's low-pass in s; 0 for none."""
    elements: int | None = None
    """Number of intervals of constant force in the reference."""


class Problem(Protocol):
    """Published numbers as a function of unprinted settings."""

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Bounds of each parameter by its name; all are searched on a logarithmic scale."""
        ...

    @property
    def alternatives(self) -> tuple[Hypothesis, ...]:
        """Hypotheses to reject, each by a search of its own."""
        ...

    def labels(self) -> list[str]:
        """Names of the numbers that are fitted, in their order."""
        ...

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each number at points (m, parameters) on the log10 scale, (m, numbers)."""
        ...


def cost(problem: Problem, points: Array, hypothesis: Hypothesis) -> Array:
    """RMS of log(measured / published) at each point, (m,)."""
    return np.asarray(np.sqrt(np.mean(problem.deviations(points, hypothesis) ** 2, axis=1)))


class Search:
    """CMA-ES from one start. It draws from one generator, so what it has found so far follows from the costs alone.

    Args:
        problem: the published numbers.
        hypothesis: what is taken for granted.
        seed: of the search, and of its start where none is given.
        start: where to begin, on the log10 scale, instead of at random.
        population: candidates a generation.
        costs: those of an interrupted search, a list of ``population`` numbers a generation: it goes on from there. The
            last generation is evaluated again, to see that they are of this search.

    Raises:
        ValueError: the costs are not of such a search.
        ImportError: the package cma is missing.
    """

    def __init__(
        self,
        problem: Problem,
        hypothesis: Hypothesis,
        seed: int,
        start: Array | None = None,
        population: int = 12,
        costs: Sequence[Sequence[float]] = (),
    ) -> None:
        try:
            import cma
        except ImportError:
            raise ImportError('identification needs cma: pip install "smo_gym[reference]"') from None
        self.problem, self.hypothesis = problem, hypothesis
        self._generator = np.random.default_rng(seed)
        low, high = np.log10(list(problem.parameters.values())).T
        options: dict[str, Any] = {
            "bounds": [low.tolist(), high.tolist()],
            "popsize": population,
            "randn": self._normal,
            "seed": math.nan,  # it draws from our generator alone
            "verbose": -9,
        }
        self.best = self._generator.uniform(low, high) if start is None else start
        # a random start looks about; from the best settings of another hypothesis the way is shorter
        self.strategy: Any = cma.CMAEvolutionStrategy(self.best, 0.3 if start is None else 0.05, options)
        self.rms = math.inf
        self.costs: list[list[float]] = []
        """RMS of each candidate, generation by generation."""
        for row in costs:
            points, known = np.array(self.strategy.ask()), array("costs", row, (population,))
            self._tell(points, known)
        # another cma, numpy or problem asks for other points: the last of them show it
        if len(costs) and not np.array_equal(cost(problem, points, hypothesis), known):
            raise ValueError(
                f"generation {len(costs)} {hypothesis.name!r} gives other costs than it holds: they were changed, or "
                "the machine, the settings or the versions of smo_gym, cma and numpy were"
            )

    @property
    def generations(self) -> int:
        """How many generations there have been."""
        return len(self.costs)

    def _normal(self, *shape: int) -> Array:
        return self._generator.standard_normal(shape)

    def step(self) -> None:
        """Draw a generation of candidates, evaluate them and learn from them."""
        points = np.array(self.strategy.ask())
        self._tell(points, cost(self.problem, points, self.hypothesis))

    def _tell(self, points: Array, costs: Array) -> None:
        self.strategy.tell(list(points), (costs**2).tolist())
        self.costs.append(costs.tolist())
        i = int(costs.argmin())
        if costs[i] < self.rms:
            self.best, self.rms = points[i], float(costs[i])


def profile(problem: Problem, hypothesis: Hypothesis, point: Array, factors: Sequence[float]) -> Array:
    """RMS deviations when one parameter at a time is multiplied by a factor, (parameters, factors).

    How fast they rise says how well each parameter is determined (the others are held, so it is a lower bound of the
    uncertainty).
    """
    points = [point + math.log10(f) * unit for unit in np.eye(len(point)) for f in factors]
    return cost(problem, np.array(points), hypothesis).reshape(len(point), len(factors))
