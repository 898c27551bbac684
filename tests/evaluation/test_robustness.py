"""What sensors and pushes do to the article's scheme."""

import math

import numpy as np
import pytest
from scipy import stats

from smo_gym.cli import robustness as cli
from smo_gym.evaluation import metrics, robustness, scenario, study
from smo_gym.evaluation.arms import ARMS
from smo_gym.friction import Friction
from smo_gym.theorem import OperatingSet, acceleration, suprema


def test_condition_30_has_all_that_disturbances_and_friction_add():
    friction = Friction(0.7, 0.4, 0.01)
    calm = OperatingSet(0.7, (1.7, 5.2), (2.0, 6.0), 0.2)
    rough = OperatingSet(0.7, (1.7, 5.2), (2.0, 6.0), 0.2, push=1.5, torque=0.02, friction=friction)
    more = suprema(rough).drift - suprema(calm).drift
    np.testing.assert_allclose(more, acceleration(rough, 0.0) - acceleration(calm, 0.0))
    rng, worst = np.random.default_rng(0), np.zeros(2)
    for _ in range(4000):  # the mass matrix, inverted by NumPy
        M_c, m, l = calm.model.perturbed(rng.choice([-0.2, 0.2], 3)).as_array()[:3]
        theta, v, omega = rng.uniform(-1, 1, 3) * [0.7, 1.7, 5.2]
        off = m * l * math.cos(theta)
        forces = [
            rng.choice([-1.5, 1.5]) - 0.7 * v - 0.4 * np.sign(v),
            rng.choice([-0.02, 0.02]) - 0.01 * omega,
        ]
        worst = np.maximum(worst, np.abs(np.linalg.solve([[M_c + m, off], [off, m * l * l]], forces)))
    assert (worst <= more).all()
    assert (worst > 0.8 * more).all()


def test_errors_count_from_the_time_on_at_which_they_have_settled():
    place = scenario.named("regulation").changed(horizon=2.5)
    with robustness.late_errors():
        (some,) = [g for g in study.groups([place], ["lqr"], ["with"], 2) if g.uncertainty == 0.2]
        (outcome,) = study.measure([some], 0, samples=2500)
    traces = outcome.traces
    late = (traces.time > 2.0 + 1e-9) & (traces.time < 2.5 + 1e-9)
    errors = (traces.xhat - traces.x)[late, 2:]
    expected = np.sqrt((errors**2).mean(axis=0))
    np.testing.assert_allclose([outcome.metrics[name] for name in robustness.COLUMNS[:2]], expected, rtol=1e-10)
    assert robustness.LATE.name not in metrics.METERS


def test_a_push_that_all_stand_is_bracketed():
    upright = scenario.named("upright").changed(horizon=3.0)
    found = {p.arm: p for p in robustness.largest_pushes(upright, cli.CASES[0], 6, 0, precision=1.0)}
    assert set(found) == {*ARMS}
    for name in ("with", "oracle"):
        push = found[name]
        assert 0.0 < push.stood < push.fell <= push.stood + 1.0
        assert 0 < push.falls <= push.runs == 6
        assert push.at_most == pytest.approx(1.0 - 0.05 ** (1.0 / 6.0))
    assert found["with"].stood < found["oracle"].stood


@pytest.mark.parametrize("weakest", ["among the few", "among the others"])
def test_the_search_finds_the_weakest_of_all_plants_and_counts_all_that_fall(weakest):
    limits = np.random.default_rng(0).uniform(30.0, 60.0, 200)
    limits[3 if weakest == "among the few" else 150] = 20.3

    def measured(wanted, seed):
        pushes = [sum(each.force for each in group.scenario.task.disturbance) for group in wanted]
        return [
            study.Outcome(group, {}, np.asarray(limits[: group.runs] < push))
            for group, push in zip(wanted, pushes, strict=True)
        ]

    upright = scenario.named("upright")
    for push in robustness.largest_pushes(upright, cli.CASES[0], len(limits), 0, measured=measured):
        assert push.stood <= 20.3 < push.fell <= push.stood + 0.1
        assert (push.falls, push.runs) == ((limits < push.fell).sum(), len(limits))
        low, high = push.surviving
        assert low == pytest.approx(stats.beta.ppf(0.025, 199, 2))
        assert high == pytest.approx(stats.beta.ppf(0.975, 200, 1))


def test_where_plants_fall_without_a_push_none_is_stood():
    upright = scenario.named("upright")
    state = {cli.CASES[0]: (0.0, 1.5, 0.0, 0.0)}
    hopeless = upright.changed(horizon=2.0, initial_states=state)
    found = robustness.largest_pushes(hopeless, cli.CASES[0], 3, 0)
    assert all(math.isnan(p.stood) and p.fell == 0.0 and p.falls > 0 and math.isnan(p.at_most) for p in found)


@pytest.mark.slow
def test_the_printed_gains_rows_are_those_of_an_independent_program(tmp_path, capsys):
    assert cli.main(["--runs", "20", "--plants", "20", "--figure", "--out", str(tmp_path)]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 100
    lines = (tmp_path / "sensors.csv").read_text().splitlines()
    header, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    value = {(r[0], r[1], r[2]): dict(zip(header, r, strict=True)) for r in rows}
    prototype = {  # errors of h' and theta' after 2 s, total variation: 20 plants of its own
        "without": {"exact": (0.073, 0.359, 69), "encoders": (0.073, 0.359, 69), "5 mrad": (0.074, 0.359, None)},
        "with": {"exact": (0.0102, 0.534, 137), "encoders": (0.0102, 0.534, 137), "5 mrad": (0.0104, 0.535, None)},
    }
    for arm, by_sensor in prototype.items():
        for sensor, numbers in by_sensor.items():
            names = ("late_rms_h_dot", "late_rms_theta_dot", "total_variation")
            for name, number in zip(names, numbers, strict=True):
                if number is not None:
                    assert float(value[sensor, "lqr", arm][name]) == pytest.approx(number, rel=0.1)
    assert {path.name for path in tmp_path.iterdir()} == {*cli.RESULTS, "robustness.pdf", "robustness.png"}
