"""The table of laws: where they run, what they are made of, what tuning minimises."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from smo_gym import VectorObserverWrapper
from smo_gym.controllers import IntegralSlidingMode, Linear
from smo_gym.evaluation import law_cases, law_settings, law_table, reading, rollout
from smo_gym.evaluation.candidates import leaves
from smo_gym.evaluation.draws import deviations
from smo_gym.evaluation.law_cases import ESTIMATES, LIMIT, MEASURED, Estimate, Place
from smo_gym.evaluation.law_objective import TRAINING, of_law
from smo_gym.evaluation.law_settings import Laws
from smo_gym.plant import CartPendulum

PLACE = Place("table-5-1", Estimate("true", MEASURED), "exact", 0.02)


@pytest.fixture(scope="module")
def laws():
    return law_settings.named()


def linear(period, model):
    return Linear((18.0, -25.0, 15.0, -3.0), period, limit=LIMIT)


def test_every_law_can_be_made_in_every_family_that_it_has_gains_for(laws):
    made = 0
    for name, law in laws.laws.items():
        for family in TRAINING:
            if law.acts(family) and not law.slow:
                agent = laws.of(name, family)(0.02, CartPendulum())
                assert agent.part(2).rows.shape[1] == 2
                made += 1
    assert made > 50


def test_all_were_tuned_with_the_same_budget(laws):
    """Notes of what was tuned say so, and no number stayed where the search began."""
    notes = [each.note for law in laws.laws.values() for each in law.tuned.values()]
    assert len(notes) > 50
    assert all(note.startswith(f"CMA-ES, {laws.budget} evaluations; objective") for note in notes)
    assert all(each.source == "identified" for law in laws.laws.values() for each in law.tuned.values())


def test_a_nominal_law_is_named_or_given(laws):
    family = "regulation-filtered"
    by_name, by_gain = (laws.of(name, family)(0.02, CartPendulum()) for name in ("ism-2", "ism-super-twisting"))
    assert isinstance(by_name, IntegralSlidingMode)
    assert by_name.nominal.K.tolist() == laws["linear"].tuned[family].value["K"]  # type: ignore[attr-defined]
    assert by_gain.nominal.K.tolist() == laws["ism-super-twisting"].tuned[family].value["nominal"]["K"]


def test_a_run_of_the_table_is_a_run_of_the_harness():
    """Its own measures, by hand from the traces: IAE from states, the last five seconds from forces."""
    found = law_cases.run(PLACE, linear, 3, 7)
    env = gymnasium.make_vec("SMOPendulum-v0", 3, autoreset_mode=AutoresetMode.DISABLED, **PLACE.options())
    case = law_cases.cases()["table-5-1"]
    plants = [CartPendulum().perturbed(0.2 * draw).as_array() for draw in deviations(7, 3)]
    reset = {"state": np.tile(case.low, (3, 1)), "params": np.array(plants)}
    observed = VectorObserverWrapper(env, PLACE.estimate.build())
    result = rollout(observed, linear(0.02, None), options=reset, trace_every=1)
    assert np.array_equal(result.metrics["mse_h"], found["mse_h"])
    late = np.abs(np.diff(result.traces.u_mean, axis=0))[-250:].sum(0)
    assert found["late_variation"] == pytest.approx(late, rel=1e-9, abs=1e-12)


def test_integrals_of_errors_are_between_their_neighbours():
    """Cauchy and Schwarz: IAE^2 <= T times the integral of squares; and the largest error bounds it from below."""
    found = law_cases.run(PLACE, linear, 5, 7)
    horizon = law_cases.cases()["table-5-1"].horizon
    for name in ("h", "theta"):
        squares = horizon * found[f"mse_{name}"]
        assert (found[f"iae_{name}"] ** 2 <= horizon * squares).all()
        assert (found[f"iae_{name}"] >= squares / found[f"peak_{name}"] - 1e-12).all()


def test_upright_starts_differ_between_runs_and_not_between_laws():
    place = Place("upright", Estimate("true", MEASURED), "exact", 0.02)
    a, b = (law_cases.run(place, linear, 4, seed) for seed in (1, 1))
    assert np.array_equal(a["mse_theta"], b["mse_theta"])
    assert len(np.unique(a["peak_theta"])) > 1


def test_outside_is_harder_than_what_was_tuned_on(laws):
    place = Place("upright", Estimate("ekf", MEASURED), "exact", 0.02, disturbed=True)
    law = laws.of("lqr", place.family)
    inside, outside = (law_cases.run(each, law, 8, 3) for each in (place, replace(place, outside=True)))
    assert outside["mse_h"].mean() != inside["mse_h"].mean()
    assert not np.array_equal(outside["peak_h"], inside["peak_h"])


def test_cells_leave_out_what_cannot_be(laws):
    told = (["linear", "lqg", "mpc"], [each.observer for each in ESTIMATES], ["table-4"], ["exact", "noise"])
    cells = law_table.cells(laws, *told, (0.001, 0.02), 200, 0)
    places = {(cell.law, cell.place.estimate.observer, cell.place.sensor, cell.place.period) for cell in cells}
    assert ("linear", "true", "exact", 0.02) in places
    assert not any(observer == "true" and sensor == "noise" for _, observer, sensor, _ in places)
    assert {observer for law, observer, _, _ in places if law == "lqg"} == {"steady-kalman"}
    assert {period for law, _, _, period in places if law == "mpc"} == {0.02}
    assert {cell.runs for cell in cells if cell.law == "mpc"} == {law_table.SLOW_RUNS}


def test_a_row_leaves_failed_runs_out_of_means_and_counts_them():
    found = law_cases.run(PLACE, linear, 4, 7)
    found["failed"] = np.array([0.0, 1.0, 0.0, 0.0])
    row = law_table.row(law_table.Cell(PLACE, "linear", 4, 7), found)
    assert row.mse_h == pytest.approx(found["mse_h"][[0, 2, 3]].mean())
    assert (row.failures, row.runs) == (1, 4)
    assert row.failures_low < 0.25 < row.failures_high
    assert row.mse_h_low < row.mse_h < row.mse_h_high
    found["failed"][:] = 1.0
    assert np.isnan(law_table.row(law_table.Cell(PLACE, "linear", 4, 7), found).mse_h)


def test_the_objective_prefers_what_is_better_and_counts_falls(laws):
    cost = of_law(laws, "linear", "regulation-filtered")
    good = cost({"K": [18.0, -25.0, 15.0, -3.0]})
    assert good < cost({"K": [7.197, -4.026, 10.96, -0.9999]}) < 20.0
    assert cost({"K": [-18.0, 25.0, -15.0, 3.0]}) > 20.0


def test_tuned_numbers_are_of_the_shape_that_the_law_takes(laws):
    for law in laws.laws.values():
        shapes = {tuple(place for place, _ in leaves(each.value)) for each in law.tuned.values()}
        assert len(shapes) <= 1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"law": "magic"}, "magic"),
        ({"settings": {"K": [1.0, 2.0]}}, None),
        ({"unknown": 1}, "unknown"),
    ],
)
def test_bad_settings_are_named(laws, change, told):
    data = laws.model_dump(mode="json", exclude_defaults=True)
    data["laws"] = {"linear": {**data["laws"]["lqr"], **change, "at": {}}}
    if told is not None:
        with pytest.raises(ValueError, match=told):
            reading.validated(data, Laws)
        return
    made = reading.validated(data, Laws).of("linear", "regulation-filtered")
    with pytest.raises(ValueError, match="K"):
        made(0.02, CartPendulum())
