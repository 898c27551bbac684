"""Likelihoods of printed cells: a planted level, planted gains, and structures that differ in what they say they do."""

import json
import math

import numpy as np
import pytest

from smo_gym.cli import identify, likelihoods
from smo_gym.evaluation import scenario
from smo_gym.evaluation.identify import table7
from smo_gym.evaluation.identify.likelihood import Prediction, posterior, ten_run_means
from smo_gym.evaluation.identify.table5 import PARAMETERS, Table5


def runs(rng, level, n):
    """Two rows of three cells, whose first two share what is random in a run."""
    shared, own = rng.standard_normal((2, n, 1)), rng.standard_normal((2, n, 1))
    return np.exp(level * np.concatenate([shared, 1.5 * shared, own], axis=2))


def test_ten_run_means_scatter_as_told():
    values = runs(np.random.default_rng(0), 0.3, 4000)
    told = ten_run_means(values)
    drawn = np.log(np.random.default_rng(1).permuted(values[0], axis=0).reshape(400, 10, 3).mean(axis=1))
    np.testing.assert_allclose(told.mean[0], drawn.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(told.covariance[0])), drawn.std(axis=0), rtol=0.15)
    assert told.covariance[0, 0, 1] == pytest.approx(
        math.sqrt(told.covariance[0, 0, 0] * told.covariance[0, 1, 1]), rel=0.05
    )
    apart = told.apart([0, 1, 1]).covariance[0]
    assert (apart[0, 1], apart[1, 2]) == (0.0, told.covariance[0, 1, 2])


@pytest.mark.parametrize("planted", [0.05, 0.1, 0.2])
def test_the_likelihood_prefers_the_planted_level(planted):
    levels = (0.05, 0.1, 0.2)
    told = [ten_run_means(runs(np.random.default_rng(i), level, 500)) for i, level in enumerate(levels)]
    rng = np.random.default_rng(7)
    printed = [np.log(runs(rng, planted, 10).mean(axis=1)) for _ in range(20)]
    of_levels = [sum(each.log_likelihood(cells, 0.01) for cells in printed) for each in told]
    assert levels[int(np.argmax(of_levels))] == planted
    # an error of the model that is larger than all scatter leaves nothing to tell levels by
    blurred = [sum(each.log_likelihood(cells, 3.0) for cells in printed) for each in told]
    assert np.ptp(blurred) < 1.0 < np.ptp(of_levels)


def test_a_log_likelihood_is_that_of_a_normal_distribution():
    one = Prediction(np.array([[0.5]]), np.array([[[0.03]]]))
    expected = -0.5 * (0.2**2 / 0.04 + math.log(2 * math.pi * 0.04))
    assert one.log_likelihood(np.array([[0.7]]), 0.1) == pytest.approx(expected)


def test_a_linear_model_gives_its_parameters_back():
    rng = np.random.default_rng(0)
    slopes, planted = rng.standard_normal((40, 3)), np.array([0.1, -0.2, 0.05])
    found = posterior(slopes @ planted, slopes, 0.01 * np.eye(40))
    np.testing.assert_allclose(found.shift, planted)
    np.testing.assert_allclose(found.residuals, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.covariance, 0.01 * np.linalg.inv(slopes.T @ slopes))
    assert found.log_evidence > posterior(slopes @ planted + 0.1, slopes, 0.01 * np.eye(40)).log_evidence


@pytest.fixture(scope="module")
def brief():
    """Table 5's cells over five seconds."""
    return Table5(scenario.named("initial-conditions").changed(horizon=5.0))


def test_planted_gains_come_back_with_their_uncertainty(brief):
    planted = np.array([0.02, -0.02, 0.02, 0.0, 0.03, -0.02])
    brief.printed = brief.nominal(planted[None])[0]
    exact = Prediction(brief.nominal(np.zeros((1, len(PARAMETERS))))[0], np.zeros((4, 4, 4)))
    found = brief.gains(exact, 0.01)
    np.testing.assert_allclose(found.shift, planted, atol=0.01)
    wider = brief.gains(exact, 0.03)
    np.testing.assert_allclose(wider.covariance, 9.0 * found.covariance, rtol=1e-6)
    point = brief.fit(range(4), np.zeros(len(PARAMETERS)))
    np.testing.assert_allclose(point, planted, atol=1e-4)
    assert brief.rms(point, [0, 3]) < 1e-4 < brief.rms(np.zeros(len(PARAMETERS)), [0, 3])


def test_equation_26_gives_other_cells(brief):
    rival = Table5(brief.scenario, "26")
    zero = np.zeros((1, len(PARAMETERS)))
    assert np.abs(rival.nominal(zero) - brief.nominal(zero)).max() > 0.05


@pytest.fixture(scope="module")
def tracking():
    return scenario.named("tracking").changed(uncertainty=(0.05, 0.2))


def test_structures_begin_at_the_settings_in_configs(tracking):
    usual = table7.Structure(tracking, "as in configs/", {})
    (known,) = usual.runs(usual.start[None], 2, 0)
    assert known.shape == (2, 2, 4)
    for structure in table7.structures(tracking)[:3]:
        (found,) = structure.runs(structure.start[None], 2, 0)
        np.testing.assert_allclose(found, known, rtol=0.3)  # SMC's runs change with the last bit of a gain


def test_structures_do_what_they_say(tracking):
    usual = table7.Structure(tracking, "as in configs/", {})
    (known,) = usual.runs(usual.start[None], 2, 0)
    one = table7.Structure(tracking, "", table7.LEVEL)
    (level,) = one.runs(np.log10([[0.2]]), 2, 0)
    assert (level[-1] == known[-1]).all()  # this row is at 20 % as it is
    assert (level[:-1] != known[:-1]).all()
    spread = table7.Structure(tracking, "", table7.SPREAD)
    near, far = spread.runs(np.log10([[0.003], [0.3]]), 2, 0)
    assert np.abs(np.log(far / known)).mean() > 2.0 * np.abs(np.log(near / known)).mean() > 0.0
    off = table7.Structure(tracking, "", table7.START)
    (moved,) = off.runs(np.log10([[1.5, 1.0]]), 2, 0)
    assert (moved[:, :, 0] != known[:, :, 0]).all()


def test_a_diverging_candidate_is_the_worst(tracking):
    usual = table7.Structure(tracking, "as in configs/", {})
    (known,) = usual.runs(usual.start[None], 4, 0)
    broken = known.copy()
    broken[1, 1, 0] = np.nan
    assert usual.log_likelihood(broken) == -math.inf < usual.log_likelihood(known)


@pytest.fixture
def few(monkeypatch, tracking):
    """The search for one structure, on the fewest plants."""
    monkeypatch.setattr(table7, "structures", lambda place: [table7.Structure(tracking, "k")])
    monkeypatch.setattr(table7, "PLANTS", 2)
    monkeypatch.setattr(likelihoods, "PLANTS", 11)


def test_a_search_for_structures_goes_on_from_what_it_saved(few, tmp_path, capsys):
    def report(folder, generations):
        options = ["--target", "structures", "--generations", str(generations), "--out", str(folder)]
        assert identify.main(options) == 0
        return capsys.readouterr().out

    through = report(tmp_path / "through", 2)
    assert "as in configs/" in through
    assert "| k " in through
    state = tmp_path / "through" / "state.json"
    saved = json.loads(state.read_text())
    saved["costs"] = [saved["costs"][0][:1]]
    state.write_text(json.dumps(saved))
    assert report(tmp_path / "through", 2) == through
    saved["costs"][0][0][0] += 1.0
    state.write_text(json.dumps(saved))
    assert identify.main(["--target", "structures", "--generations", "2", "--out", str(tmp_path / "through")]) == 2
    assert "state.json is damaged (generation 1" in capsys.readouterr().err
