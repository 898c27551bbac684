"""Identification: its cells, its determinism, its resumption."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from smo_gym.evaluation import scenario
from smo_gym.evaluation.identification import ALTERNATIVES, Hypothesis, Table5, profile

ROOT = Path(__file__).resolve().parent.parent
KNOWN = np.log10([51.8, 57.4, 59.3, 0.284, 12.5, 12.5])
pytest.importorskip("cma")


@pytest.fixture(scope="module")
def problem():
    one = scenario.load(ROOT / "configs" / "initial-conditions.yaml")
    return Table5(dict(one.initial_states.value), one.control_period.value)


def rms(problem, hypothesis):
    return float(np.sqrt(problem.cost(KNOWN[None], hypothesis)[0] / 16))


def test_the_settings_in_configs_fit_and_the_alternatives_do_not(problem):
    ours = rms(problem, Hypothesis())
    assert ours < 0.03
    for alternative in ALTERNATIVES:
        assert rms(problem, alternative) > 3 * ours, alternative.name


def test_candidates_do_not_disturb_each_other(problem):
    other = KNOWN + 0.1
    together = problem.cost(np.array([KNOWN, other, KNOWN]), Hypothesis())
    assert together[0] == together[2] == problem.cost(KNOWN[None], Hypothesis())[0]
    assert together[1] != together[0]


def test_the_profile_rises_away_from_the_optimum(problem):
    around = profile(problem, Hypothesis(), KNOWN, (0.8, 1.25))
    assert (around[:3] > rms(problem, Hypothesis())).all()


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
