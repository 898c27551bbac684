"""Identification: its cells, its determinism, its resumption."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

from smo_gym.evaluation import scenario
from smo_gym.evaluation.identify.search import Hypothesis, Search, cost, profile
from smo_gym.evaluation.identify.unprinted import Lqr, Regulation, Tracking

KNOWN = np.log10([51.8, 57.4, 59.3, 0.284, 12.5, 12.5])
pytest.importorskip("cma")


@pytest.fixture(scope="module")
def problem():
    return Lqr(scenario.named("initial-conditions"))


@pytest.fixture(scope="module")
def brief():
    """The same problem over five seconds, for what does not depend on how well it fits."""
    return Lqr(scenario.named("initial-conditions").changed(horizon=5.0))


def rms(problem, hypothesis):
    return float(cost(problem, KNOWN[None], hypothesis)[0])


@pytest.mark.slow
def test_the_settings_in_configs_fit_and_the_alternatives_do_not(problem):
    ours = rms(problem, Hypothesis())
    assert ours < 0.03
    for alternative in problem.alternatives:
        assert rms(problem, alternative) > 3 * ours, alternative.name


def test_candidates_do_not_disturb_each_other(brief):
    other = KNOWN + 0.1
    together = cost(brief, np.array([KNOWN, other, KNOWN]), Hypothesis())
    assert together[0] == together[2] == cost(brief, KNOWN[None], Hypothesis())[0]
    assert together[1] != together[0]


@pytest.mark.slow
def test_the_profile_rises_away_from_the_optimum(problem):
    around = profile(problem, Hypothesis(), KNOWN, (0.8, 1.25))
    assert (around[:3] > rms(problem, Hypothesis())).all()


@pytest.mark.slow
def test_the_settings_in_configs_fit_tables_4_and_5_under_smc():
    problem = Regulation(scenario.named("initial-conditions"), scenario.named("regulation"))
    assert len(problem.labels()) == 24
    point = np.log10([1.4, 3.4, 3.3, 0.8, 33.3, 1.52, 1.18, 0.14, 0.2])
    other_k3, other_h = point.copy(), point.copy()
    other_k3[2], other_h[5] = np.log10([2.0, 1.0])
    off = problem.deviations(np.array([point, other_k3, other_h]), Hypothesis())
    here, there, elsewhere = np.sqrt(np.mean(off**2, axis=1))
    assert here < 0.11 < 0.2 < there
    assert elsewhere > 0.2
    assert (off[0, :16] == off[2, :16]).all()  # Table 4's x(0) is nothing to Table 5


def test_the_settings_in_configs_fit_table_7():
    tracking = Tracking(scenario.named("tracking"))
    ours = np.log10([[2.5, 2.4, 2.7, 0.86], [1.4, 3.4, 3.3, 0.8]])
    here, there = cost(tracking, ours, Hypothesis())
    assert here < 0.15 < there
    assert cost(tracking, ours[:1], Hypothesis(estimate_starts_at_truth=True))[0] > 2 * here


def test_only_printed_cells_can_be_fitted():
    tracking = scenario.named("tracking").changed(uncertainty=(0.05, 0.12))
    with pytest.raises(ValueError, match="the article has no cell .*uncertainty_percent='12'"):
        Tracking(tracking)


def test_a_search_begins_where_it_is_told(problem):
    search = Search(problem, Hypothesis(), 0, KNOWN)
    search.step()
    assert search.rms < 0.1
    np.testing.assert_allclose(search.best, KNOWN, atol=0.3)


@pytest.fixture(scope="module")
def through(brief):
    """A search of three generations."""
    search = Search(brief, Hypothesis(), 0)
    for _ in range(3):
        search.step()
    return search


def test_costs_bring_a_search_back_to_the_bit(brief, through):
    again = Search(brief, Hypothesis(), 0, costs=json.loads(json.dumps(through.costs[:2])))
    again.step()
    assert again.costs == through.costs
    assert np.array_equal(again.best, through.best)
    assert again.rms == through.rms


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda costs: [costs[0], [*costs[1][:-1], 0.001]], "gives other costs"),
        (lambda costs: costs * 2, "gives other costs"),
        (lambda costs: costs[1:], "gives other costs"),
        (lambda costs: [costs[0][:11]], r"it must have shape \(12,\)"),
        (lambda costs: [["x"] * 12], "must be an array of numbers"),
        (lambda costs: [[10**400] * 12], "must be an array of numbers"),
        (lambda costs: [[None] * 12], "must be finite"),
    ],
)
def test_costs_of_another_search_are_refused(brief, through, change, message):
    """A cost that was changed, another version of cma, other plants: all would end in a wrong number."""
    with pytest.raises(ValueError, match=message):
        Search(brief, Hypothesis(), 0, costs=change(through.costs[:2]))


def identify(out, *options):
    command = [sys.executable, str(ROOT / "agents" / "identify.py"), "--target", "tracking", "--restarts", "1"]
    return [*command, "--refit", "0", *options, "--out", str(out)]


@pytest.mark.slow
def test_an_interrupted_search_resumes_to_the_same_result(tmp_path):
    through = identify(tmp_path / "through", "--generations", "2")
    subprocess.run(through, check=True, capture_output=True)
    stopped = identify(tmp_path / "stopped", "--generations", "2")
    process = subprocess.Popen(
        stopped,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a parent may ignore it
    )
    while not (tmp_path / "stopped" / "state.json").exists() and process.poll() is None:
        pass
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert process.returncode == 130
    assert not (tmp_path / "stopped" / "report.json").exists()
    subprocess.run(stopped, check=True, capture_output=True)
    reports = [json.loads((tmp_path / name / "report.json").read_text()) for name in ("through", "stopped")]
    assert reports[0] == reports[1]
    other = subprocess.run(
        identify(tmp_path / "stopped", "--generations", "4"), capture_output=True, text=True, check=False
    )
    assert other.returncode == 2
    assert "belongs to a run with --generations 2, not --generations 4: choose another --out" in other.stderr


def test_bad_arguments_are_named(command, tmp_path):
    done = command("identify", "--generations", "0", "--out", tmp_path, check=False)
    assert done.returncode == 2
    assert "--generations: '0' must be a whole number of at least 1" in done.stderr


def test_a_state_that_only_unpickling_could_read_is_refused(command, tmp_path):
    (tmp_path / "state.pkl").write_bytes(b"cos\nsystem\n(S'exit 3'\ntR.")
    done = command("identify", "--out", tmp_path, check=False)
    assert done.returncode == 2
    assert "state.pkl: is of an older version and is not opened" in done.stderr
    (tmp_path / "state.pkl").unlink()
    (tmp_path / "state.json").write_text('{"plan": 1')
    done = command("identify", "--out", tmp_path, check=False)
    assert (done.returncode, "state.json is damaged" in done.stderr) == (2, True)
