"""Arms of the comparison: what they differ in, and that they are on the same plants."""

import math

import numpy as np
import pytest

from smo_gym.evaluation import settled, settling, settling_search, study
from smo_gym.evaluation.settling import ARMS, COLUMNS, Column

LQR = Column("regulation", "lqr", "zero")


def test_a_constant_gain_is_the_printed_one_at_a_constant_force():
    gains = LQR.constant(2.0)
    assert gains["beta_1"] == pytest.approx((0.01 + 2.0 * 1.9, 0.1 + 2.0 * 0.5))
    assert gains["beta_2"] == (0.0, 0.0)
    assert LQR.constant(0.0)["beta_1"] == LQR.printed.beta_1


def test_tuned_arms_differ_in_two_numbers():
    found = settled.ours()
    constant, scaled = (LQR.gains(arm, found) for arm in (settling.BETA_1, settling.BETA_2))
    assert constant["beta_2"] == (0.0, 0.0)
    assert scaled["beta_1"] == LQR.printed.beta_1
    assert constant["m1"] == scaled["m1"] == LQR.printed.m1
    assert {LQR.gains(arm, found) is None for arm in ("without", "with", "oracle")} == {True}


def test_table_5_has_what_was_found_on_table_4():
    found = settled.ours()
    for arm in (settling.BETA_1, settling.BETA_2):
        assert Column("initial-conditions", "smc", "zero").gains(arm, found) == Column(
            "regulation", "smc", "zero"
        ).gains(arm, found)


def test_all_columns_have_all_arms_on_the_same_plants():
    found = settled.ours()
    wanted = settling.wanted(found, 3)
    assert {*wanted} == {(column, arm) for column in COLUMNS for arm in ARMS}
    places = [
        [(g.uncertainty, g.case, g.runs) for g in groups] for (column, _), groups in wanted.items() if column == LQR
    ]
    assert all(place == places[0] for place in places)


def test_a_column_begins_where_it_says():
    for start, xhat0 in (("zero", (0.0, 0.0, 0.0, 0.0)), ("measured", "measured")):
        for name, laws in settling.LAWS.items():
            for law in laws:
                place = Column(name, law, start).place()
                assert [*place.controllers] == [law]
                assert place.controllers[law].observer.xhat0.value == xhat0


def test_equal_effort_is_interpolated_nearest_to_the_equal_mean_or_where_it_comes_nearest():
    constants = np.array([0.0, 1.0, 3.0])
    twice = np.array([0.5, 2.0, 0.5])
    assert settling_search.equal(constants, twice, 0.1) == (pytest.approx(0.5), 1.0)
    assert settling_search.equal(constants, twice, 5.0) == (pytest.approx(2.0), 1.0)
    assert settling_search.equal(constants, np.array([0.2, 0.9, 0.5]), 1.0) == (1.0, 0.9)


def test_a_run_tells_its_mean_force_and_the_share_of_its_error():
    brief = LQR.place().changed(horizon=3.0, uncertainty=(0.1,))
    with settling.measuring():
        _, outcome = study.measure(study.groups([brief], ["lqr"], ["with"], 2), 0, samples=3000)
    traces = outcome.traces
    u, late = traces.u[1:], slice(2001, None)
    error, speed = (traces.xhat - traces.x)[late, 2], traces.x[late, 2]
    assert outcome.metrics["mean_force"] == pytest.approx(np.abs(u).mean(0))
    shares = np.sqrt((error**2).mean(0) / (speed**2).mean(0))
    assert outcome.metrics["error_share_h_dot"] == pytest.approx(shares)


def test_the_search_knows_no_plant_of_a_table():
    assert settled.ours().seed == settling_search.SEED
    assert settled.ours().budget == settling_search.BUDGET


@pytest.mark.slow
def test_the_gains_that_come_with_the_package_are_those_of_the_search():
    found = settled.ours()
    with settling.measuring():
        mean, effort, _ = settling_search.matched(LQR, lambda evaluations: None)
        begin = settling_search.trained(LQR, LQR.gains(settling.BETA_1, found))
        printed = settling_search.trained(LQR)
    ours = found.matched["regulation"]["lqr"]["zero"]
    assert (mean, effort) == pytest.approx((ours.mean.value, ours.effort.value), rel=1e-3)
    cost = np.mean([begin[f"mse_{state}"] / printed[f"mse_{state}"] for state in settling.STATES])
    assert f"{cost:.4g}" in found.tuned["regulation"]["lqr"]["zero"].beta_1.note
    assert math.isfinite(cost)
