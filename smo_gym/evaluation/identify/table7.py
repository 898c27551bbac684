"""Structures that might stand behind Table 7's scatter, each with the parameters that make its 24 cells likeliest."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...article import Cell, published
from ...controllers import SlidingModeController
from ...plant import CartPendulum
from ...typing import Array
from ..arms import PRINTED
from ..draws import deviations as draws
from ..scenario import Scenario
from ..settings import Four, SmcSettings
from ..verdicts import PRINTED_RUNS, ceiling
from .likelihood import Prediction, ten_run_means
from .runs import STATES, mse
from .search import Hypothesis

ERROR = 0.05
"""Relative error of the model in every cell: more than LQR's, for SMC's cells move with a rounded gain."""
PLANTS = 10
"""Plants a level in the searches."""
K: dict[str, tuple[float, float]] = {f"k{i}": (0.3, 10.0) for i in (1, 2, 3, 4)}
SLOPES = {"slope": (5.0, 150.0), "k_p": (3.0, 45.0), "k_v": (3.0, 45.0)}
START = {"h(0)": (0.3, 3.0), "theta(0)": (0.3, 1.5)}
LEVEL = {"level": (0.03, 0.45)}
SPREAD = {"spread": (0.003, 0.4)}
USUAL = Hypothesis()
# The logarithm of what a run that diverges counts as, so that the search leads away from it.
_WORST = math.log(1e9)


@dataclass(frozen=True)
class Structure:
    """Table 7 as a function of some parameters; the others are as in ``configs/``.

    One of the problems of :class:`~smo_gym.evaluation.identify.search.Search`.
    """

    scenario: Scenario
    name: str
    parameters: dict[str, tuple[float, float]] = field(default_factory=lambda: K)
    hypothesis: Hypothesis = USUAL
    boundary: Four | None = None
    """Where reference and run begin instead."""
    apart: bool = False
    """Whether each arm has plants of its own."""
    alternatives: ClassVar[tuple[Hypothesis, ...]] = ()

    @property
    def start(self) -> Array:
        """The parameters in ``configs/``, on the log10 scale; for those that are none there, a first guess."""
        settings = self._settings
        x0 = self._place.initial_states.value[""]
        known = {
            **{f"k{i + 1}": value for i, value in enumerate(settings.k.value)},
            "slope": settings.slope.value,
            **dict(zip(("k_p", "k_v"), settings.observer.slopes.value, strict=True)),
            **dict(zip(("h(0)", "theta(0)"), x0, strict=False)),
            "level": 0.2,
            "spread": 0.05,
        }
        return np.log10([known[name] for name in self.parameters])

    @property
    def _settings(self) -> SmcSettings:
        settings = self.scenario.controllers["smc"]
        assert isinstance(settings, SmcSettings)
        return settings

    @property
    def _place(self) -> Scenario:
        return self.scenario if self.boundary is None else self.scenario.changed(initial_states={"": self.boundary})

    def labels(self) -> list[str]:
        """Of the one number that is searched for."""
        return ["perplexity"]

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """The perplexity exp(-log likelihood / cells) at points (m, parameters) on the log10 scale, (m, 1)."""
        runs = self.runs(points, PLANTS, seed=0)
        cells = printed(self.scenario).size
        return np.array([[math.exp(min(-self.log_likelihood(values) / cells, _WORST))] for values in runs])

    def log_likelihood(self, values: Array) -> float:
        """Of the printed cells, given runs (levels, plants, cells)."""
        if not np.isfinite(values).all():
            return -math.inf
        return self.prediction(values).log_likelihood(printed(self.scenario), ERROR)

    def prediction(self, values: Array) -> Prediction:
        """What runs (levels, plants, cells) say of means of ten."""
        found = ten_run_means(values)
        arms = [arm for arm in range(len(PRINTED)) for _ in STATES]
        return found.apart(arms) if self.apart else found

    def runs(self, points: Array, plants: int, seed: int) -> Array:
        """MSE of every run, (m, levels, plants, arms times states), NaN where it failed."""
        m = len(points)
        values = dict(zip(self.parameters, 10.0 ** np.asarray(points).T, strict=True))
        settings, dt, levels = self._settings, self.scenario.control_period.value, self.scenario.uncertainty.value

        def column(name: str, usual: float) -> Array:
            return np.asarray(values.get(name, np.full(m, usual)))

        k = np.stack([column(f"k{i + 1}", usual) for i, usual in enumerate(settings.k.value)], axis=1)
        slope = column("slope", settings.slope.value)
        usual = settings.observer
        pairs = np.stack([column(name, x) for name, x in zip(("k_p", "k_v"), usual.slopes.value, strict=True)], axis=1)
        observers = [usual.changed(slopes=tuple(pair)).build(True) for pair in pairs.tolist()]
        (x0,) = self._place.initial_states.value.values()
        start = np.stack([column(name, x0[i]) for i, name in enumerate(START)], axis=1)
        starts = np.concatenate([start, np.tile(x0[2:], (m, 1))], axis=1)[:, None, None]
        n = plants * len(levels)
        moved = np.random.default_rng([seed, 7]).uniform(-1.0, 1.0, (n, 4))
        starts = starts + column("spread", 0.0)[:, None, None, None] * moved
        scale = np.stack([column("level", level) for level in levels], axis=1)
        deltas = np.stack([draws(seed + i, plants) for i in range(len(levels))])
        nominal = CartPendulum().as_array()
        params = np.tile(nominal, (m, len(levels), plants, 1))
        params[..., :3] *= 1.0 + scale[:, :, None, None] * deltas
        found = mse(
            self._place,
            self.hypothesis,
            observers,
            lambda each: SlidingModeController(np.repeat(k, each, axis=0), dt, np.repeat(slope, each), wrap=False),
            starts,
            params.reshape(m, n, 4),
        )
        by_plant = np.moveaxis(found[:, 0], 2, 1)  # (m, plants, arms, states)
        return by_plant.reshape(m, len(levels), plants, -1)


def printed(scenario: Scenario) -> Array:
    """Logarithms of Table 7's cells, (levels, arms times states)."""
    cells = [
        [published()[Cell("7", "smc-tracking", f"{100 * x:g}", "", "mse", s, arm)] for arm in PRINTED for s in STATES]
        for x in scenario.uncertainty.value
    ]
    return np.asarray(np.log(cells))


def structures(scenario: Scenario) -> list[Structure]:
    """What is tried."""

    def with_reference(name: str, hypothesis: Hypothesis = USUAL, boundary: Four | None = None) -> Structure:
        return Structure(scenario, name, hypothesis=hypothesis, boundary=boundary)

    return [
        Structure(scenario, "k"),
        Structure(scenario, "k and slopes of tanh", K | SLOPES),
        Structure(scenario, "the run begins off the reference", K | START),
        with_reference("reference from Table 4's start", boundary=(1.52, 1.18, 0.14, 0.2)),
        with_reference("reference from Table 5's case 4", boundary=(-0.2, 1.0, 0.1, 0.01)),
        with_reference("horizon 8 s", Hypothesis(horizon=8.0, elements=32)),
        with_reference("horizon 12 s", Hypothesis(horizon=12.0, elements=48)),
        with_reference("elements of 0.2 s", Hypothesis(elements=50)),
        Structure(scenario, "arms on different plants", apart=True),
        Structure(scenario, "starts scatter, U(-s, s)", K | SPREAD),
        Structure(scenario, "every row at one level", K | LEVEL),
    ]


def of_columns(scenario: Scenario) -> tuple[float, int, int]:
    """What no structure stands behind: a mean and a scatter for each column, whatever the level.

    Returns:
        The log likelihood of the printed cells, how many of them are within 10 % of their column's
        geometric mean, and of how many.
    """
    cells = printed(scenario)
    off = cells - cells.mean(axis=0)
    likelihood = -float(np.sum(np.log(off.std(axis=0)) + 0.5 * math.log(2.0 * math.pi) + 0.5)) * len(cells)
    return likelihood, int(np.count_nonzero(np.abs(np.expm1(-off)) <= 0.1)), off.size


@dataclass(frozen=True, slots=True)
class Verdict:
    """What other plants than a search's say of its structure."""

    log_likelihood: float
    near: int
    """Cells within 10 % of the printed."""
    cells: int
    ceiling: float
    """How many cells means of ten runs would bring within 10 %, if the structure were true."""
    scatter: tuple[float, ...]
    """Standard deviation of ten-run means beside that of the printed cells over the levels, for each column."""


def verdict(structure: Structure, point: Array, plants: int) -> Verdict:
    """A structure's cells from fresh plants."""
    (values,) = structure.runs(point[None], plants, seed=100)
    target, mean = printed(structure.scenario), values.mean(axis=1)
    off = np.expm1(np.log(mean) - target)
    variance = np.mean((values.std(axis=1, ddof=1) / mean) ** 2, axis=0) / PRINTED_RUNS
    return Verdict(
        structure.log_likelihood(values),
        int(np.count_nonzero(np.abs(off) <= 0.1)),
        off.size,
        sum(ceiling(cell) for row in values for cell in row.T),
        tuple(float(x) for x in np.sqrt(variance) / target.std(axis=0, ddof=1)),
    )
