"""Intervals over plants: paired, of all plants or of ten, and none where there is one."""

import math

import numpy as np
import pytest

from smo_gym.evaluation import estimates
from smo_gym.evaluation.estimates import Estimate, estimate

PLANTS = np.random.default_rng(0).lognormal(0.0, 0.5, (3, 200))


def test_what_is_of_one_plant_stays_together():
    found = estimate(estimates.reduction, PLANTS, 0.5 * PLANTS)
    assert (found.low, found.number, found.high) == pytest.approx((50.0, 50.0, 50.0))


def test_the_interval_of_a_mean_is_that_of_its_standard_error():
    found = estimate(estimates.mean, PLANTS)
    error = PLANTS.mean(0).std(ddof=1) / math.sqrt(200)
    assert (found.high - found.low) / (2 * 1.96 * error) == pytest.approx(1.0, abs=0.1)


def test_ten_plants_say_less_than_two_hundred():
    wide, narrow = (estimate(estimates.mean, PLANTS, size=size) for size in (10, None))
    assert (wide.high - wide.low) / (narrow.high - narrow.low) == pytest.approx(math.sqrt(20), rel=0.2)


def test_a_single_plant_has_no_interval_and_none_no_number():
    one = estimate(estimates.mean, PLANTS[:, :1])
    assert one.bounds == (one.number, one.number)
    assert math.isnan(one.low)
    assert math.isnan(estimate(estimates.mean, PLANTS[:, :0]).number)


def test_reductions_are_of_the_averages_or_averages_of_reductions():
    without, compensated = np.array([[1.0], [3.0]]), np.array([[0.5], [3.0]])
    assert estimates.reduction(without, compensated) == pytest.approx(12.5)
    assert estimates.mean_reduction(without, compensated) == pytest.approx(25.0)
    assert estimates.root_reduction(without, compensated) == pytest.approx(100.0 * (1.0 - math.sqrt(0.875)))
    assert estimates.better(without, compensated) == pytest.approx(50.0)


def test_a_number_without_interval_lies_at_itself():
    assert Estimate(2.0).bounds == (2.0, 2.0)
    assert Estimate(2.0, 1.0, 3.0).bounds == (1.0, 3.0)
