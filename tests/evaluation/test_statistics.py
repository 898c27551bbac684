"""Statistics: small cases worked out by hand, and how often an interval holds the mean."""

import numpy as np
import pytest

from smo_gym.article import Cell, published
from smo_gym.evaluation import metrics, statistics, study
from smo_gym.evaluation.report import tables


def outcome(small, level, arm, values, failed=None):
    group = study.Group(small, "lqr", level, "", arm, len(values))
    values = np.array(values, dtype=float)
    each = dict.fromkeys(metrics.names(), values)
    return study.Outcome(group, each, np.zeros(len(values), dtype=bool) if failed is None else np.array(failed))


def find(results, **where):
    (found,) = [r for r in results if all(getattr(r.cell, name) == value for name, value in where.items())]
    return found


def test_means_medians_reductions_and_averages(small):
    results = statistics.results(
        [
            outcome(small, 0.1, "without", [0.10, 0.12, 0.20]),
            outcome(small, 0.1, "with", [0.05, 0.03, 0.04]),
            outcome(small, 0.2, "without", [0.20, 0.22, 0.30]),
            outcome(small, 0.2, "with", [0.10, 0.08, 0.09]),
        ]
    )
    mean = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
    assert (mean.measured, mean.median, mean.runs, mean.failures) == (pytest.approx(0.14), 0.12, 3, 0)
    assert mean.ci_low < 0.14 < mean.ci_high
    assert mean.published == published()[Cell("4", "lqr", "10", "", "mse", "h", "without")]
    rms = find(results, uncertainty_percent="10", metric="rms", state="h", compensation="with")
    assert rms.measured == pytest.approx(np.sqrt(0.04))
    reduction = find(results, uncertainty_percent="20", metric="mse_reduction_percent", state="theta")
    assert reduction.measured == pytest.approx(100 * (1 - 0.09 / 0.24))
    assert reduction.ci_low < reduction.measured < reduction.ci_high
    average = find(results, uncertainty_percent="average", metric="mse", state="h", compensation="without")
    assert average.measured == pytest.approx((0.14 + 0.24) / 2)
    assert average.published == pytest.approx((0.1175 + 0.1178) / 2)
    of_averages = find(results, uncertainty_percent="average", metric="mse_reduction_percent", state="h")
    assert of_averages.measured == pytest.approx(100 * (1 - (0.04 + 0.09) / (0.14 + 0.24)))


def test_failed_runs_are_counted_and_kept_out_of_means(small):
    results = statistics.results(
        [
            outcome(small, 0.1, "without", [0.1, np.inf, 0.3, 0.2], [False, True, False, False]),
            outcome(small, 0.1, "with", [0.1, 0.1, 0.1, 99.0], [False, False, False, True]),
        ]
    )
    mean = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
    assert (mean.measured, mean.failures, mean.runs) == (pytest.approx(0.2), 1, 4)
    reduction = find(results, uncertainty_percent="10", metric="mse_reduction_percent", state="h")
    assert (reduction.runs, reduction.failures) == (4, 2)
    assert reduction.measured == pytest.approx(100 * (1 - (0.1 + 0.1) / (0.1 + 0.3)))  # over the pairs that are whole
    assert "2 of 8 runs failed" in tables.render(results, "simple", rms=False)
    nothing = statistics.results([outcome(small, 0.1, "with", [np.nan, np.nan], [True, True])])
    assert find(nothing, uncertainty_percent="10", metric="mse", state="h").failures == 2


@pytest.mark.slow
def test_intervals_of_ten_runs_hold_the_mean_as_often_as_they_say(small):
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(400):
        without = rng.normal(1.0, 0.1, 10)
        both = [
            outcome(small, 0.1, "without", without),
            outcome(small, 0.1, "with", without * rng.normal(0.4, 0.04, 10)),
        ]
        results = statistics.results(both)
        mean = find(results, uncertainty_percent="10", metric="mse", state="h", compensation="without")
        reduction = find(results, uncertainty_percent="10", metric="mse_reduction_percent", state="h")
        held += np.array([mean.ci_low <= 1.0 <= mean.ci_high, reduction.ci_low <= 60.0 <= reduction.ci_high])
    assert (held > 0.92 * 400).all()
    assert (held < 0.98 * 400).all()
