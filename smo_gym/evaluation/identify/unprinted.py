"""Three problems of identification, one for each block of identified settings in ``configs/``.

One generation of the optimiser is a batch or two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...article import Cell, published
from ...controllers import LQR, SlidingModeController
from ...observers import SlidingModeObserver
from ...plant import CartPendulum
from ...typing import Array
from ..arms import PRINTED
from ..scenario import Scenario
from ..settings import LqrSettings, SmcSettings
from .runs import STATES, mse, random_plants
from .search import Hypothesis

# A run that diverges counts as a hundredfold MSE, so that the search leads away from it.
_DIVERGED = math.log(100.0)

_START = Hypothesis("xhat(0) = x(0)", estimate_starts_at_truth=True)
_HORIZONS = tuple(Hypothesis(f"horizon {s:g} s", horizon=s) for s in (20.0, 30.0, 40.0))


def _against(measured: Array, printed: Sequence[Any]) -> Array:
    """log(measured / printed) of candidates (m, ...) beside one table (...), flattened to (m, numbers)."""
    flat = measured.reshape(len(measured), -1)
    return np.where(np.isfinite(flat), np.log(flat / np.ravel(printed)), _DIVERGED)


def _printed(cell: Cell) -> float:
    """A published number.

    Raises:
        ValueError: the article prints no such cell.
    """
    try:
        return published()[cell]
    except KeyError:
        raise ValueError(
            f"the article has no cell {cell}: a scenario's levels and cases must be the printed ones"
        ) from None


def _averages(table: str, controller: str, levels: Sequence[float]) -> list[list[float]]:
    """Published column averages over levels, by arm and state."""
    return [
        [
            float(np.mean([_printed(Cell(table, controller, f"{100 * x:g}", "", "mse", s, arm)) for x in levels]))
            for s in STATES
        ]
        for arm in PRINTED
    ]


def _table5(controller: str, cases: Sequence[str]) -> list[Any]:
    """Published cells by case, arm and state."""
    return [[[_printed(Cell("5", controller, "", c, "mse", s, arm)) for s in STATES] for arm in PRINTED] for c in cases]


def _labels(first: Sequence[str]) -> list[str]:
    return [f"{place}, {arm}, {state}" for place in first for arm in PRINTED for state in STATES]


class Lqr:
    """LQR weights (R = 1) and the observer's slopes, from Table 5's sixteen LQR cells.

    On the nominal plant: the level of uncertainty moves LQR's averages far less than the error of the fit.

    Raises:
        ValueError: a case of the scenario is not a printed one (the others' levels likewise).
    """

    parameters: ClassVar[dict[str, tuple[float, float]]] = {
        **dict.fromkeys(("q_h", "q_theta", "q_h_dot"), (1.0, 1000.0)),
        "q_theta_dot": (1e-2, 1e2),
        "k_p": (3.0, 45.0),
        "k_v": (3.0, 45.0),
    }
    alternatives: ClassVar[tuple[Hypothesis, ...]] = (
        Hypothesis("g = +9.8 m/s^2", gravity=9.8),
        _START,
        Hypothesis("low-pass of 50 ms", time_constant=0.05),
        *_HORIZONS,
    )

    def __init__(self, initial_conditions: Scenario) -> None:
        self.scenario = initial_conditions
        self._cases = initial_conditions.initial_states.value
        self._cells = _table5("lqr", list(self._cases))

    def labels(self) -> list[str]:
        """Case, arm and state of each fitted cell of Table 5."""
        return _labels([f"case {c}" for c in self._cases])

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each cell at points (m, parameters) on the log10 scale, (m, cells)."""
        values = 10.0 ** np.asarray(points)
        model = CartPendulum(gravity=hypothesis.gravity)
        K = np.array([LQR.design(v[:4], 1.0, model).K[0] for v in values])
        observers = [SlidingModeObserver("lqr", slopes=(v[4], v[5]), model=model) for v in values]
        starts = np.repeat([list(self._cases.values())], len(values), axis=0)
        found = mse(
            self.scenario,
            hypothesis,
            observers,
            lambda n: LQR(np.repeat(K, n, axis=0), wrap=False),
            starts,
            model.as_array()[None],
        )
        return _against(found.mean(axis=3), self._cells)


class Regulation:
    """k1..k4, the slope of SMC's tanh and Table 4's x(0), from Table 5's SMC cells and Table 4's eight averages.

    LQR and the observer are as in ``configs/``. SMC is sensitive and is averaged over plants: six at Table 5's level,
    one at each of Table 4's.
    """

    parameters: ClassVar[dict[str, tuple[float, float]]] = {
        **{f"k{i}": (0.3, 10.0) for i in (1, 2, 3, 4)},
        "slope": (5.0, 150.0),
        "h(0)": (0.3, 3.0),
        "theta(0)": (0.3, 1.5),
        "h'(0)": (0.01, 1.0),
        "theta'(0)": (0.01, 1.0),
    }
    alternatives: ClassVar[tuple[Hypothesis, ...]] = (_START, *_HORIZONS)

    def __init__(self, initial_conditions: Scenario, regulation: Scenario) -> None:
        self.table5, self.table4 = initial_conditions, regulation
        self._cases = initial_conditions.initial_states.value
        self._cells = _table5("smc", list(self._cases))
        self._averages = [_averages("4", name, regulation.uncertainty.value) for name in ("smc", "lqr")]

    def labels(self) -> list[str]:
        """Case, arm and state of Table 5's cells, then controller, arm and state of Table 4's averages."""
        return _labels([f"Table 5, case {c}" for c in self._cases] + ["Table 4, SMC", "Table 4, LQR"])

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each cell at points (m, parameters) on the log10 scale, (m, cells)."""
        values = 10.0 ** np.asarray(points)
        lqr, smc = (self.table4.controllers[name] for name in ("lqr", "smc"))
        assert isinstance(lqr, LqrSettings)
        dt = self.table4.control_period.value
        smc_observers, lqr_observers = ([controller.observer.build(True)] * len(values) for controller in (smc, lqr))

        def law(n: int) -> SlidingModeController:
            return SlidingModeController(
                np.repeat(values[:, :4], n, axis=0), dt, np.repeat(values[:, 4], n), wrap=False
            )

        cases = np.repeat([list(self._cases.values())], len(values), axis=0)
        x0, plants = values[:, None, 5:], random_plants(self.table4.uncertainty.value, 1)
        table5 = mse(
            self.table5, hypothesis, smc_observers, law, cases, random_plants(self.table5.uncertainty.value, 6)
        )
        with_smc = mse(self.table4, hypothesis, smc_observers, law, x0, plants)
        with_lqr = mse(self.table4, hypothesis, lqr_observers, lambda n: lqr.build(dt), x0, plants)
        table4 = np.stack([with_smc.mean(axis=(1, 3)), with_lqr.mean(axis=(1, 3))], axis=1)
        parts = [_against(table5.mean(axis=3), self._cells), _against(table4, self._averages)]
        return np.concatenate(parts, axis=1)


class Tracking:
    """k1..k4 of tracking, from the four column averages of Table 7; four plants at each of its levels."""

    parameters: ClassVar[dict[str, tuple[float, float]]] = {f"k{i}": (0.3, 10.0) for i in (1, 2, 3, 4)}
    alternatives: ClassVar[tuple[Hypothesis, ...]] = (
        _START,
        Hypothesis("horizon 8 s", horizon=8.0, elements=32),
        Hypothesis("horizon 12 s", horizon=12.0, elements=48),
        Hypothesis("elements of 0.2 s", elements=50),
        Hypothesis("elements of 0.5 s", elements=20),
    )

    def __init__(self, tracking: Scenario) -> None:
        self.scenario = tracking
        self._averages = _averages("7", "smc-tracking", tracking.uncertainty.value)

    def labels(self) -> list[str]:
        """Arm and state of each column average of Table 7."""
        return _labels(["average"])

    def deviations(self, points: Array, hypothesis: Hypothesis) -> Array:
        """log(measured / published) of each cell at points (m, parameters) on the log10 scale, (m, cells)."""
        settings, dt = self.scenario.controllers["smc"], self.scenario.control_period.value
        assert isinstance(settings, SmcSettings)
        k = 10.0 ** np.asarray(points)
        (x0,) = self.scenario.initial_states.value.values()
        found = mse(
            self.scenario,
            hypothesis,
            [settings.observer.build(True)] * len(k),
            lambda n: SlidingModeController(np.repeat(k, n, axis=0), dt, settings.slope.value, wrap=False),
            np.tile(x0, (len(k), 1, 1)),
            random_plants(self.scenario.uncertainty.value, 4),
        )
        return _against(found.mean(axis=(1, 3)), self._averages)
