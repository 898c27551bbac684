"""What the article proves, as claims: Theorems 1 and 2, their conditions, the properties, assumptions and remarks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from .. import theorem
from ..controllers import SlidingModeController
from ..observers import Gains
from ..plant import CartPendulum
from ..typing import Array
from . import configs, scenario
from .claims import Claim, above, below
from .estimates import Estimate, estimate, median
from .exact import Exact
from .theorem_on_runs import Convergence
from .theorem_sweep import Row
from .traces import Traces

NEARLY, ZERO, WHOLE, NEARLY_ALL = 0.1, 1e-9, 99.0, 95.0
"""An error below a tenth is none, one below rounding zero; all are more than 99 %, of a hundred runs 95 %. Chosen."""
LAST = 5.0
"""Seconds at the end of a run, in which what converges has converged."""
_FASTEST = 10.0


@dataclass(frozen=True, slots=True)
class Evidence:
    """What was computed for them."""

    converged: Convergence
    """Runs of ``smo-gym theorem``."""
    swept: list[Row]
    """Designs of its sweep, without noise, by margin."""
    exact: Exact
    """The set-valued sgn."""
    along: dict[str, Traces]
    """Nominal runs of Table 5's cases, by controller."""
    sliding: Traces
    """SMC with compensation from Table 4's start, on random plants."""


def share(successes: int, of: int) -> Estimate:
    """Percent, with its Wilson interval."""
    sure = stats.binomtest(successes, of).proportion_ci(method="wilson")
    return Estimate(100.0 * successes / of, 100.0 * sure.low, 100.0 * sure.high)


def claims(found: Evidence, settle: str, proved: str) -> list[Claim]:
    """All of them.

    Args:
        found: what was computed.
        settle: the command that this is part of.
        proved: the command that prints the theorem's numbers.
    """
    model = [*_model(settle), *_assumptions(found, settle)]
    return [*model, *_first(found, settle, proved), *_second(found, settle), *_remarks(found, settle, proved)]


def _model(settle: str) -> list[Claim]:
    plant = CartPendulum()
    theta = np.linspace(-math.pi, math.pi, 361)
    grid = np.array([part.ravel() for part in np.meshgrid([0.0], theta, [0.0], np.linspace(-_FASTEST, _FASTEST, 21))])
    largest = max(_curvature(function, grid) for function in (plant.drift, plant.gain))
    light = plant.perturbed(np.full(3, -0.2))
    M_c, m, l, _ = light.as_array()
    least = float((np.minimum(1.0, l) * (M_c + m * np.sin(theta) ** 2)).min())
    bounded = "second partial derivatives of f and g are bounded where x is (largest, |theta'| <= 10 rad/s)"
    positive = "denominators of f_2 and g_2 remain positive (the least, plants within 20 %)"
    return [
        Claim("Property 1", bounded, Estimate(largest), below(math.inf), settle),
        Claim("Property 2", positive, Estimate(least), above(0.0), settle),
    ]


def _curvature(function: Any, x: Array, step: float = 1e-3) -> float:
    """The largest second difference quotient in theta and theta'."""
    shifts = [step * np.eye(4)[i][:, None] for i in (1, 3)]
    found = [
        (function(x + a + b) - function(x + a - b) - function(x - a + b) + function(x - a - b)) / (4.0 * step**2)
        for a in shifts
        for b in shifts
    ]
    return float(np.abs(found).max())


def _assumptions(found: Evidence, settle: str) -> list[Claim]:
    cases = np.array(list(scenario.named("initial-conditions").initial_states.value.values()))
    start = np.linalg.norm(cases[:, 2:], axis=1).max()
    speeds = [np.linalg.norm(traces.x[:, 2:], axis=1) for traces in found.along.values()]
    fastest = max(float(each.max()) for each in speeds)
    errors = max(float(np.abs((each.x - each.xhat)[0]).max()) for each in found.along.values())
    farthest = float(np.linalg.norm(cases, axis=1).max())
    return [
        Claim(
            "Assumption 1",
            "x(0) lies in a bounded set (largest |x(0)| of Table 5)",
            Estimate(farthest),
            below(math.inf),
            settle,
        ),
        Claim(
            "Assumption 1",
            "the supremum over X_0, the initial states, as (28) has it, bounds |X_2(t)| (largest, in suprema)",
            Estimate(fastest / float(start)),
            below(1.0 + ZERO),
            settle,
        ),
        Claim(
            "Assumption 2",
            "initial errors are bounded by known constants (largest entry, xhat(0) = 0, Table 5)",
            Estimate(errors),
            below(math.inf),
            settle,
        ),
    ]


def _first(found: Evidence, settle: str, proved: str) -> list[Claim]:
    exact, converged = found.exact, found.converged
    stayed, n = int(converged.stayed.sum()), len(converged.stayed)
    tanh = float(np.nanmax(converged.velocity_error[:, converged.tested]))
    over = scenario.load_theorem(configs.path("theorem")).over(CartPendulum())
    designed = theorem.conditions(theorem.design(over), theorem.suprema(over))
    least = min(float(row.gain.min() / _norm(row)) for row in designed) - 1.0
    said = {
        "(28)": "m_1 exceeds the speeds",
        "(30)": "beta_{i,1} exceed the error of the drift",
        "(31)": "beta_{i,2} exceed the error of the input gain",
    }
    return [
        Claim("Theorem 1", "states and estimates remain bounded (runs, %)", share(stayed, n), above(WHOLE), proved),
        Claim(
            "Theorem 1",
            "exact sgn: positions are estimated exactly from t_0 of (43) on (largest error)",
            Estimate(exact.position),
            below(ZERO),
            settle,
        ),
        Claim(
            "Theorem 1",
            "exact sgn: velocities after t_1 are exact in the limit of small steps (order of their error in the step)",
            estimate(median, exact.order[None]),
            above(0.5),
            settle,
        ),
        Claim(
            "Theorem 1",
            "with tanh, as simulated, xhat = x from t_1 on (largest error of a velocity)",
            Estimate(tanh),
            below(ZERO),
            proved,
        ),
        Claim(
            "Conclusion 1",
            "there are gains that satisfy (28), (30) and (31) (least margin of a designed gain)",
            Estimate(least),
            above(0.0),
            settle,
        ),
        *(
            Claim(f"Theorem 1, {name}", f"{what}: printed gains, Table 5 (least margin)", margin, above(0.0), settle)
            for name, what in said.items()
            for margin in [Estimate(_margin(found, name))]
        ),
        Claim(
            "Conclusion 1",
            "(34)-(35) estimate the velocities (error as a share of theta', exact sgn, designed gains)",
            estimate(median, exact.shares["34"][None]),
            below(NEARLY),
            settle,
        ),
        Claim(
            "Conclusion 1",
            "(26) with (33), whose Xhat_1' has Xhat_2 too, estimate the velocities (the same share)",
            estimate(median, exact.shares["26"][None]),
            below(NEARLY),
            settle,
        ),
    ]


def _norm(row: theorem.Condition) -> float:
    return float(np.linalg.norm(row.supremum) if row.name == "(28)" else row.supremum.max())


def _margin(found: Evidence, name: str) -> float:
    """By how much the smaller printed gain exceeds the supremum along runs, at the worst."""
    margins = []
    for controller, traces in found.along.items():
        gains = Gains.of(scenario.named("initial-conditions").controllers[controller].observer.gains.value)
        for i in range(traces.x.shape[2]):
            bounds = theorem.suprema_along(traces.x[:, :, i].T, traces.xhat[:, :, i].T, CartPendulum())
            row = next(each for each in theorem.conditions(gains, bounds) if each.name == name)
            margins.append(float(row.gain.min()) - _norm(row))
    return min(margins)


def _second(found: Evidence, settle: str) -> list[Claim]:
    law = scenario.named("regulation").agent("smc")
    assert isinstance(law, SlidingModeController)
    runs = found.sliding
    k1, k2, k3, k4 = law.k
    s = 0.5 * (k1 * runs.x[:, 0] + k3 * runs.x[:, 2]) ** 2 + 0.5 * (k2 * runs.x[:, 1] + k4 * runs.x[:, 3]) ** 2
    layer = law.epsilon / (math.pi * float(law.slope))
    late = np.flatnonzero(runs.time >= runs.time[-1] - LAST)
    push, needed = zip(*(theorem.controllability(law, runs.xhat[:, :, i].T) for i in range(s.shape[1])), strict=True)
    holds = 100.0 * np.mean(np.array(push) > np.array(needed), axis=1)
    reached = int((s.min(axis=0) <= layer).sum())
    rms = np.sqrt((runs.x[late, :2] ** 2).sum(axis=1).mean(axis=0))
    begun = np.linalg.norm(runs.x[0, :2], axis=0)
    smallest = float(np.array(push).min() / law.Z0)
    return [
        Claim("Theorem 2", "(51) holds at all times (least left side)", Estimate(smallest), above(0.0), settle),
        Claim("Theorem 2", "(52) holds at all times (% of them)", estimate(median, holds[None]), above(WHOLE), settle),
        Claim(
            "Theorem 2",
            "s(x) comes into the layer of tanh about 0 (runs, %)",
            share(reached, s.shape[1]),
            above(NEARLY_ALL),
            settle,
        ),
        Claim(
            "Theorem 2",
            f"s(x) stays in the layer of tanh about 0 (largest s of the last {LAST:g} s, in layers)",
            estimate(median, s[late].max(axis=0)[None] / layer),
            below(1.0),
            settle,
        ),
        Claim(
            "Remark 5",
            "(52) holds in the neighbourhood that contains the trajectory (most of a run, %)",
            Estimate(float(holds.max())),
            above(WHOLE),
            settle,
        ),
        Claim(
            "Remark 6",
            f"the plant is regulated though (51) is violated (RMS of X_1 in the last {LAST:g} s over |X_1(0)|)",
            estimate(median, (rms / begun)[None]),
            below(NEARLY),
            settle,
        ),
    ]


def _remarks(found: Evidence, settle: str, proved: str) -> list[Claim]:
    converged = found.converged
    n, kept = int(converged.stayed.sum()), int((converged.kept & converged.stayed).sum())
    bounded = int((converged.bounded.all(axis=(0, 1)) & converged.stayed).sum())
    times = np.array([row.slowest for row in found.swept])
    return [
        Claim(
            "Remark 1",
            "M may be constant but for |u|: positions are in their layers by t_0 (runs, %)",
            share(kept, n),
            above(WHOLE),
            proved,
        ),
        Claim(
            "Remark 2",
            "t_1 can be made as small as one likes (largest ratio of the slowest times, from margin to margin)",
            Estimate(float((times[1:] / times[:-1]).max())),
            below(1.0),
            settle,
        ),
        Claim(
            "Remark 7",
            "with tanh the designed observer converges (runs that keep the bounds for tanh, %)",
            share(bounded, n),
            above(WHOLE),
            proved,
        ),
    ]
