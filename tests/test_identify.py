"""Identification: its cells, its determinism, its resumption."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from smo_gym.evaluation import scenario
from smo_gym.evaluation.identification import ALTERNATIVES, Hypothesis, Table5, Table7, cost, profile

ROOT = Path(__file__).resolve().parent.parent
KNOWN = np.log10([51.8, 57.4, 59.3, 0.284, 12.5, 12.5])
pytest.importorskip("cma")


@pytest.fixture(scope="module")
def problem():
    return Table5(scenario.load(ROOT / "configs" / "initial-conditions.yaml"), "lqr")


def rms(problem, hypothesis):
    return float(cost(problem, KNOWN[None], hypothesis)[0])


def test_the_settings_in_configs_fit_and_the_alternatives_do_not(problem):
    ours = rms(problem, Hypothesis())
    assert ours < 0.03
    for alternative in ALTERNATIVES:
        assert rms(problem, alternative) > 3 * ours, alternative.name


def test_candidates_do_not_disturb_each_other(problem):
    other = KNOWN + 0.1
    together = cost(problem, np.array([KNOWN, other, KNOWN]), Hypothesis())
    assert together[0] == together[2] == cost(problem, KNOWN[None], Hypothesis())[0]
    assert together[1] != together[0]


def test_the_profile_rises_away_from_the_optimum(problem):
    around = profile(problem, Hypothesis(), KNOWN, (0.8, 1.25))
    assert (around[:3] > rms(problem, Hypothesis())).all()


def test_the_settings_in_configs_fit_table_5_under_smc():
    smc = Table5(scenario.load(ROOT / "configs" / "initial-conditions.yaml"), "smc")
    point = np.log10([1.4, 3.4, 3.3, 0.8, 33.3, 12.5, 12.5])
    worse = np.log10([1.4, 3.4, 2.0, 0.8, 33.3, 12.5, 12.5])
    here, there = cost(smc, np.array([point, worse]), Hypothesis())
    assert here < 0.1 < 0.2 < there


def test_the_settings_in_configs_fit_table_7():
    tracking = Table7(scenario.load(ROOT / "configs" / "tracking.yaml"))
    here, there = cost(tracking, np.log10([[2.5, 2.4, 2.7, 0.86], [1.4, 3.4, 3.3, 0.8]]), Hypothesis())
    assert here < 0.15 < there


def identify(out, *options):
    command = [sys.executable, str(ROOT / "agents" / "identify.py"), "--restarts", "1", "--refit", "0"]
    return [*command, *options, "--out", str(out)]


def test_an_interrupted_search_resumes_to_the_same_result(tmp_path):
    through = identify(tmp_path / "through", "--generations", "3")
    subprocess.run(through, check=True, capture_output=True)
    stopped = identify(tmp_path / "stopped", "--generations", "3")
    process = subprocess.Popen(stopped, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    while not (tmp_path / "stopped" / "state.pkl").exists() and process.poll() is None:
        pass
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert not (tmp_path / "stopped" / "report.json").exists()
    subprocess.run(stopped, check=True, capture_output=True)
    reports = [json.loads((tmp_path / name / "report.json").read_text()) for name in ("through", "stopped")]
    assert reports[0] == reports[1]
    other = subprocess.run(
        identify(tmp_path / "stopped", "--generations", "4"), capture_output=True, text=True, check=False
    )
    assert other.returncode == 2
    assert "belongs to a run with" in other.stderr


def test_bad_arguments_are_named(tmp_path):
    done = subprocess.run(identify(tmp_path, "--generations", "0"), capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--generations must be at least 1" in done.stderr
