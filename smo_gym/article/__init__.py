"""What the article prints: its tables of results as data, and its constants.

The article is "Finite-Time State Estimation for an Inverted Pendulum under Input-Multiplicative Uncertainty", Robotics
2020, 9(4), 87. Table 2 (the plant) is the default of :class:`smo_gym.CartPendulum`. What the article does not print
(slopes, the LQR gain, k1..k4, Table 4's initial state, the horizon) is not here: see ``configs/``.
"""

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

OBSERVER_GAINS = {
    "lqr": {"m1": (2.0, 2.0), "beta_1": (0.01, 0.1), "beta_2": (1.9, 0.5)},
    "smc": {"m1": (2.0, 2.0), "beta_1": (0.02, 0.1), "beta_2": (0.05, 0.5)},
}
"""Table 3, one entry a column: (m_11, m_12), (beta_{1,1}, beta_{2,1}), (beta_{1,2}, beta_{2,2})."""

WITHOUT, WITH = "without", "with"
"""The tables' column ``compensation``: whether the observer has that of the input uncertainty (Remark 3)."""

SMC_GAINS = {"Z0": 26.0, "lam": 30.0, "epsilon": 0.1460}
"""Table 6 (printed for tracking; the article does not say whether regulation used them)."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Where a published number stands. Empty strings where a column does not apply."""

    table: str
    controller: str
    uncertainty_percent: str
    case: str
    metric: str
    state: str
    compensation: str

    @property
    def is_average(self) -> bool:
        """Whether it is in the row of averages of its table."""
        return "average" in (self.uncertainty_percent, self.case)


@cache
def published() -> dict[Cell, float]:
    """The 176 printed cells of Tables 4, 5 and 7 (104 MSE, 72 RMS)."""
    text = resources.files(__package__).joinpath("published.csv").read_text(encoding="utf-8")
    return {Cell(**row): float(value) for row in csv.DictReader(text.splitlines()) for value in [row.pop("value")]}
