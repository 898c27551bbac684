"""Table 5's LQR cells once more: how likely each level of uncertainty makes them, how sharply the gains, and (26)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from ...article import Cell, published
from ...controllers import LQR
from ...plant import CartPendulum
from ...typing import Array
from ..arms import PRINTED
from ..scenario import Scenario
from ..settings import LqrSettings
from .likelihood import Posterior, Prediction, posterior, ten_run_means
from .runs import STATES, mse, random_plants
from .search import Hypothesis

PARAMETERS = ("K1", "K2", "K3", "K4", "k_p", "k_v")
"""The gain's entries and the observer's slopes, each as the logarithm of what multiplies the one in ``configs/``."""
_STEP = 0.02
# Far enough for any gain; steeper slopes than e^1.2 times ours want a shorter step of the observer.
_REACH = np.array([3.0, 3.0, 3.0, 3.0, 1.2, 1.2])


class Table5:
    """The sixteen cells as a function of LQR's gain and the observer's slopes.

    Args:
        scenario: Table 5's.
        equation: of the observer's injection, "34" or "26".
    """

    def __init__(self, scenario: Scenario, equation: str = "34") -> None:
        settings = scenario.controllers["lqr"]
        assert isinstance(settings, LqrSettings)
        self.scenario, self.equation = scenario, equation
        self.cases = scenario.initial_states.value
        self.K, self.slopes = np.array(settings.K.value), np.array(settings.observer.slopes.value)
        self.printed = np.log(
            [
                [published()[Cell("5", "lqr", "", case, "mse", s, arm)] for arm in PRINTED for s in STATES]
                for case in self.cases
            ]
        )
        """Logarithms of the printed cells, (cases, arms times states)."""

    def runs(self, points: Array, plants: Array) -> Array:
        """MSE of every run at points (m, parameters), (m, cases, plants, arms times states)."""
        m, factors = len(points), np.exp(points)
        gains, slopes = self.K * factors[:, :4], self.slopes * factors[:, 4:]
        observer = self.scenario.controllers["lqr"].observer.build(compensation=True)
        observers = [replace(observer, slopes=tuple(pair), injection=self.equation) for pair in slopes.tolist()]
        starts = np.repeat([list(self.cases.values())], m, axis=0)
        found = mse(
            self.scenario,
            Hypothesis(),
            observers,
            lambda n: LQR(np.repeat(gains, n, axis=0), wrap=False),
            starts,
            plants,
        )
        return np.moveaxis(found, 3, 2).reshape(m, len(self.cases), plants.shape[-2], -1)

    def nominal(self, points: Array) -> Array:
        """Logarithms of the cells of the nominal plant, (m, cases, arms times states); a failed run's is far off."""
        values = self.runs(points, CartPendulum().as_array()[None]).mean(axis=2)
        return np.where(np.isfinite(values), np.log(values), 5.0)

    def derivatives(self, point: Array) -> Array:
        """Of the cells' logarithms by the parameters, on the nominal plant, (cases, arms times states, parameters)."""
        steps = _STEP * np.eye(len(PARAMETERS))
        up, down = np.split(self.nominal(np.concatenate([point + steps, point - steps])), 2)
        return np.moveaxis((up - down) / (2.0 * _STEP), 0, -1)

    def at_level(self, level: float, plants: int) -> Prediction:
        """What ten-run means are to be expected at a level of uncertainty, with the settings of ``configs/``."""
        return ten_run_means(self.runs(np.zeros((1, len(PARAMETERS))), random_plants([level], plants))[0])

    def gains(self, prediction: Prediction, error: float) -> Posterior:
        """The parameters after the printed cells at a level of uncertainty with a model's error."""
        slopes = self.derivatives(np.zeros(len(PARAMETERS))).reshape(-1, len(PARAMETERS))
        residuals = (self.printed - prediction.mean).ravel()
        return posterior(residuals, slopes, block_diag(*prediction.with_error(error)))

    def fit(self, cases: Sequence[int], start: Array) -> Array:
        """The parameters that fit some of the cases best, by least squares on the nominal plant."""
        rows = list(cases)

        def off(point: Array) -> Array:
            return np.asarray((self.nominal(point[None])[0, rows] - self.printed[rows]).ravel())

        def slopes(point: Array) -> Array:
            return self.derivatives(point)[rows].reshape(-1, len(PARAMETERS))

        found = least_squares(off, start, slopes, bounds=(-_REACH, _REACH), x_scale=0.1, max_nfev=20)
        return np.asarray(found.x)

    def rms(self, point: Array, cases: Sequence[int]) -> float:
        """Root mean square of log(measured/published) over the cells of some cases, on the nominal plant."""
        off = self.nominal(point[None])[0, list(cases)] - self.printed[list(cases)]
        return float(np.sqrt(np.mean(off**2)))


@dataclass(frozen=True, slots=True)
class HoldOut:
    """How two cases of the table, which an equation was fitted to, predict the other two; RMS."""

    equation: str
    fitted: tuple[str, ...]
    inside: float
    outside: float


def hold_out(table: Table5, starts: int, seed: int) -> list[HoldOut]:
    """All cases fitted from some starts, which leave none to predict; then from the best every pair of cases."""
    names = list(table.cases)
    everything = tuple(range(len(names)))
    scatter = 0.2 * np.random.default_rng(seed).standard_normal((starts, len(PARAMETERS)))
    scatter[0] = 0.0
    best = min((table.fit(everything, start) for start in scatter), key=lambda point: table.rms(point, everything))
    found = []
    for chosen in (everything, *combinations(everything, 2)):
        point = best if chosen == everything else table.fit(chosen, best)
        others = [case for case in everything if case not in chosen]
        outside = table.rms(point, others) if others else float("nan")
        found.append(HoldOut(table.equation, tuple(names[i] for i in chosen), table.rms(point, chosen), outside))
    return found
