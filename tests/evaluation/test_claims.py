"""Verdicts follow from numbers: where a number changes, its verdict does."""

import csv
import io
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from smo_gym.evaluation import claims, claims_of_runs, estimates, settled, settling
from smo_gym.evaluation.claims import Claim, Printed, above, below
from smo_gym.evaluation.estimates import Estimate
from smo_gym.evaluation.study import Outcome

METRICS = (
    *("mse_h", "mse_theta", "estimation_rms_h_dot", "estimation_rms_theta_dot", "total_variation"),
    *settling.SHARES,
)


@pytest.mark.parametrize(
    ("rule", "found", "verdict"),
    [
        (above(0.0), Estimate(1.0, 0.5, 1.5), "holds"),
        (above(0.0), Estimate(1.0, -0.5, 2.5), "undecided"),
        (above(0.0), Estimate(-1.0, -1.5, -0.5), "fails"),
        (above(0.0), Estimate(0.0), "fails"),
        (above(0.0), Estimate(math.nan), "undecided"),
        (below(1.0), Estimate(0.5), "holds"),
        (below(1.0), Estimate(0.9, 0.7, 1.1), "undecided"),
        (below(1.0), Estimate(1.0), "fails"),
        (below(math.inf), Estimate(1e300), "holds"),
        (below(math.inf), Estimate(math.inf), "fails"),
        (Printed(29.0, 0.5), Estimate(29.3), "holds"),
        (Printed(29.0, 0.5), Estimate(18.6), "fails"),
        (Printed(29.0), Estimate(30.0, 28.0, 31.0), "holds"),
        (Printed(29.0), Estimate(30.0, 29.5, 31.0), "fails"),
        (Printed(29.0, fitted=True), Estimate(30.0, 28.0, 31.0), "undecided"),
        (Printed(29.0, fitted=True), Estimate(30.0, 29.5, 31.0), "fails"),
        (Printed(29.0), Estimate(math.nan), "undecided"),
    ],
)
def test_a_verdict_is_what_the_interval_says(rule, found, verdict):
    assert Claim("Abstract", "something", found, rule, "smo-gym settle").verdict == verdict


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setattr(estimates, "RESAMPLES", 100)
    monkeypatch.setattr(claims_of_runs, "RESAMPLES", 100)


WANTED = cache(lambda: settling.wanted(settled.ours(), 20))


def runs(factor, start="zero", shares=1.0):
    """Made-up runs of all arms, in which compensation multiplies the MSE by a factor where the observer starts so."""
    rng = np.random.default_rng(0)
    outcomes = {}
    for (column, arm), groups in WANTED().items():
        worse = factor if arm == "with" and column.start == start else 1.0
        outcomes[column, arm] = [
            Outcome(
                group,
                {
                    name: (shares if name in settling.SHARES else worse) * rng.uniform(0.95, 1.05, group.runs)
                    for name in METRICS
                },
                np.zeros(group.runs, dtype=np.bool_),
            )
            for group in groups
        ]
    return settling.Runs(outcomes)


def verdicts(found):
    return {
        each.claim.partition(" (")[0]: each.verdict for each in claims_of_runs.claims(found, "settle", "consistency")
    }


def test_compensation_that_betters_all_runs_holds_and_one_that_worsens_them_fails():
    claim = "compensation lowers every MSE, xhat(0) = 0"
    other = "compensation lowers every MSE, xhat(0) = [y(0), 0, 0]"
    better, worse = runs(0.5), runs(2.0)
    assert (verdicts(better)[claim], verdicts(worse)[claim]) == ("holds", "fails")
    assert verdicts(better)[other] == "undecided"  # nothing is known of it: the arms are alike
    assert verdicts(runs(0.5, "measured"))[other] == "holds"


def test_what_fails_in_one_column_fails_in_all():
    found = runs(0.5)
    column = found.columns[0]
    for outcome in found.outcomes[column, "with"]:
        outcome.metrics["mse_theta"] *= 10.0
    told = [
        each for each in claims_of_runs.claims(found, "settle", "consistency") if "every MSE, xhat(0) = 0" in each.claim
    ]
    assert [(each.verdict, each.claim.partition("%: ")[2]) for each in told] == [
        ("fails", "Table 4 LQR from 0, theta)")
    ]


def test_an_estimate_that_is_near_holds():
    claim = "the state is estimated after 2 s, Table 4 LQR from 0"
    assert (verdicts(runs(0.5))[claim], verdicts(runs(0.5, shares=0.01))[claim]) == ("fails", "holds")


def test_runs_that_failed_leave_the_pair():
    found = runs(0.5)
    column = found.columns[0]
    first, *others = found.outcomes[column, "without"]
    second, *rest = others
    failed = np.arange(20) == 3
    found.outcomes[column, "without"] = [first, replace(second, failed=failed), *rest]
    without, compensated = found.pair(column, "without", "with", "mse_h")
    assert without.shape == compensated.shape == (6, 19)
    assert found.failed(column, "without") == 1


def test_the_file_has_a_line_a_claim_with_its_command():
    told = [
        Claim("Remark 2", "first", Estimate(0.5), below(1.0), "smo-gym theorem"),
        Claim("Abstract", "second", Estimate(3.0, 2.0, 4.0), above(2.5), "smo-gym settle"),
    ]
    lines = [*csv.reader(io.StringIO(claims.as_csv(sorted(told, key=claims.order))))]
    assert lines == [
        ["claim", "place", "verdict", "number", "interval", "command"],
        ["second", "Abstract", "undecided", "3.0", "[2, 4]", "smo-gym settle"],
        ["first", "Remark 2", "holds", "0.5", "", "smo-gym theorem"],
    ]
    assert claims.counts(told) == "Of 2 statements: 1 hold, 0 fail, 1 undecided."
