"""What tuning a law minimises: the mean squares of both positions and a little of the force's variation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from .candidates import Tree
from .law_cases import MEASURED, ZERO, Estimate, Place, cases, run
from .law_settings import Laws

TRAINING: dict[str, Place] = {
    "regulation-printed": Place("table-4", Estimate("printed", ZERO), "exact", 0.02),
    "regulation-filtered": Place("table-4", Estimate("ekf", MEASURED), "noise", 0.02),
    "upright-filtered": Place("upright", Estimate("ekf", MEASURED), "noise", 0.02, disturbed=True),
    "tracking-printed": Place("tracking", Estimate("printed", ZERO), "exact", 0.001),
    "tracking-filtered": Place("tracking", Estimate("ekf", MEASURED), "noise", 0.02),
    **{
        f"learning-{kind}": Place("learning", Estimate(kind, start), "exact", 0.02)
        for kind, start in (("smo", ZERO), ("smo-uncompensated", ZERO), ("state", MEASURED))
    },
}
"""Where the laws of each family are tuned; of "learning" where PPO learns, on what it is told."""
SEED = 20_000
"""Of the training plants."""
FALL = 20.0
"""Cost of a run that fails, beside about 2 of a good one."""
_VARIATION = 100.0


def of_law(laws: Laws, name: str, family: str) -> Callable[[Tree], float]:
    """The objective of a law in a family, of its numbers.

    ``((mse_h / a)^p + (mse_theta / b)^p)^(1/p) + w ln(TV / 100 N) + 20 (share of runs that fail)``, means over training
    plants that did not fail, with the family's scales (a, b), norm p and smoothness w; more where none stands.
    """
    place = TRAINING[family]
    place = replace(place, estimate=laws[name].estimate or place.estimate, period=laws[name].period or place.period)
    settings = laws.families[family]
    (a, b), p, weight = settings.scales, settings.norm, settings.smoothness

    def cost(tuned: Tree) -> float:
        found = run(place, laws.of(name, family, tuned), settings.runs, SEED)
        stood = found["failed"] == 0.0
        if not stood.any():  # the later the better, or a search would see no slope
            return FALL * (2.0 - float(found["duration"].mean()) / cases()[place.case].horizon)
        h, theta, variation = (float(found[key][stood].mean()) for key in ("mse_h", "mse_theta", "total_variation"))
        smooth = weight * math.log(max(variation, 1e-9) / _VARIATION)
        size: float = ((h / a) ** p + (theta / b) ** p) ** (1.0 / p)
        return size + smooth + FALL * float(1.0 - stood.mean())

    return cost
