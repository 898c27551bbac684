"""What is proved: each verdict follows from what was computed, and changes with it."""

from dataclasses import replace

import numpy as np
import pytest

from smo_gym.evaluation import claims_of_theory, evidence
from smo_gym.evaluation.claims_of_theory import Evidence
from smo_gym.evaluation.exact import Exact
from smo_gym.evaluation.theorem_on_runs import Convergence
from smo_gym.evaluation.theorem_pieces import RUNS
from smo_gym.evaluation.theorem_sweep import Row
from smo_gym.evaluation.traces import Traces

N = 500


def traces(x, xhat):
    time = np.linspace(0.0, 35.0, len(x))
    u = np.zeros((len(x), x.shape[2]))
    return Traces(time, x, xhat, u, u, u, u, None)


def converged(**changes):
    ones, none = np.ones((2, N)), np.zeros((2, N))
    return replace(
        Convergence(
            stayed=np.ones(N, dtype=np.bool_),
            promised=ones,
            reached=none,
            promised_velocity=ones,
            velocity_error=none,
            bounded=np.ones((3, 2, N), dtype=np.bool_),
            velocity_bound=np.ones(2),
            velocity_settled=none,
            squares={},
            settled_instants=1,
            largest=np.ones(7),
            horizon=6.0,
        ),
        **changes,
    )


def swept(*times):
    return [Row(i, 1e-3, "none", time, time, time, np.ones(2), np.ones(2)) for i, time in enumerate(times)]


STILL = np.concatenate([np.ones((1, 4, 100)), np.zeros((700, 4, 100))])
"""At rest in the origin from the first instant on."""
CALM = Evidence(
    converged=converged(),
    swept=swept(0.3, 0.2, 0.1),
    exact=Exact(0.0, np.ones(50), {"34": np.full(50, 1e-3), "26": np.full(50, 1e-3)}),
    along={name: traces(1e-6 * STILL, 1e-6 * STILL) for name in ("lqr", "smc")},
    sliding=traces(STILL, STILL),
)
MOVING = 2.0 * np.ones_like(STILL)


def verdicts(found):
    told = claims_of_theory.claims(found, "settle", "theorem")
    return {f"{each.place}: {each.claim}": each.verdict for each in told}


def verdict(found, claim):
    """Of the one claim that begins so."""
    (said,) = [said for told, said in verdicts(found).items() if told.startswith(claim)]
    return said


@pytest.mark.parametrize(
    ("claim", "change"),
    [
        ("Theorem 1: states and estimates remain bounded", {"converged": converged(stayed=np.arange(N) > 20)}),
        (
            "Theorem 1: with tanh, as simulated, xhat = x from t_1 on",
            {"converged": converged(velocity_error=np.full((2, N), 1e-3))},
        ),
        (
            "Theorem 1: exact sgn: positions are estimated exactly from t_0 of",
            {"exact": replace(CALM.exact, position=0.1)},
        ),
        (
            "Theorem 1: exact sgn: velocities after t_1 are exact in the limit of small steps",
            {"exact": replace(CALM.exact, order=np.zeros(50))},
        ),
        (
            "Conclusion 1: (26) with",
            {"exact": replace(CALM.exact, shares={"34": np.zeros(50), "26": np.full(50, 0.5)})},
        ),
        ("Theorem 2: s(x) stays in the layer of tanh about 0", {"sliding": traces(MOVING, MOVING)}),
        ("Theorem 2: s(x) comes into the layer of tanh about 0", {"sliding": traces(MOVING, MOVING)}),
        ("Remark 6: the plant is regulated though", {"sliding": traces(MOVING, MOVING)}),
        (
            "Remark 1: M may be constant but for |u|: positions are in their layers by t_0",
            {"converged": converged(reached=2.0 * np.ones((2, N)))},
        ),
        ("Remark 2: t_1 can be made as small as one likes", {"swept": swept(0.3, 0.2, 0.25)}),
        (
            "Remark 7: with tanh the designed observer converges",
            {"converged": converged(bounded=np.zeros((3, 2, N), dtype=np.bool_))},
        ),
    ],
)
def test_a_verdict_changes_with_its_number(claim, change):
    assert verdict(CALM, claim) == "holds"
    assert verdict(replace(CALM, **change), claim) == "fails"


def test_the_conditions_depend_on_the_runs():
    fast = np.array(1e-6 * STILL)
    fast[5, 2] = 3.0
    assert verdict(CALM, "Theorem 1, (28)") == "holds"
    assert verdict(replace(CALM, along={"smc": traces(fast, fast)}), "Theorem 1, (28)") == "fails"


def test_on_s_zero_neither_condition_of_theorem_2_can_hold():
    assert [verdict(CALM, claim) for claim in ("Theorem 2: (51)", "Theorem 2: (52)", "Remark 5")] == ["fails"] * 3


@pytest.mark.slow
def test_of_the_observer_as_it_is(monkeypatch):
    for name, few in (("RUNS", 2), ("SWEPT", 4), ("SLIDING", 3)):
        monkeypatch.setattr(evidence, name, few)
    done = []
    found = evidence.evidence(0, None, done.append)
    assert sum(done) == 2 + evidence.WORK - RUNS
    assert found.exact.shares["26"] == pytest.approx(0.5, abs=1e-3)  # sliding on X2tilde, Xhat2 follows half of X2
    assert verdict(found, "Theorem 1: exact sgn: velocities") == "holds"
    assert verdict(found, "Theorem 1: with tanh, as simulated, xhat = x") == "fails"
    assert verdict(found, "Theorem 2: s(x) stays") == "fails"
    assert verdict(found, "Property 2") == "holds"
