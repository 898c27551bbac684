"""Arms of a user's own: one file and one call, and they are wherever arms are."""

import csv
import importlib.util
import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from smo_gym import SlidingModeObserver
from smo_gym.evaluation import arms, scenario, statistics, study
from smo_gym.evaluation.arms import ARMS, Arm, register
from smo_gym.evaluation.report import page, panels, tables

ROOT = Path(__file__).resolve().parents[2]
SMALL = f"""
extends: {ROOT}/configs/regulation.yaml
control_period: {{value: 0.01, source: chosen}}
horizon: {{value: 1.0, source: chosen}}
uncertainty: {{value: [0.1, 0.2], source: chosen}}
"""


class Held:
    """Positions as measured, and no speed: no dataclass, no settings."""

    def start(self, n, dt, force, nominal):
        return Measured(n)


class Measured:
    def __init__(self, n):
        self.xhat = np.zeros((4, n))

    def reset(self, slots, y):
        self.xhat[:2, slots] = y[:, slots]

    def update(self, samples, u):
        self.xhat = np.concatenate([samples[-1], np.zeros_like(samples[-1])])


@dataclass
class Picky:
    """One that cannot work anywhere."""

    def start(self, n, dt, force, nominal):
        raise TypeError("not here")


def steep(settings, scenario, task):
    return SlidingModeObserver(gains="smc", slopes=(20.0, 20.0))


@pytest.fixture
def own(registry):
    """Two arms of a user's."""
    register(Arm("steep", "steeper slopes", "#7A5C00", "#D9B84A", steep))
    register(Arm("held", "no speed", "#555555", "#AAAAAA", lambda settings, scenario, task: Held()))
    return ["steep", "held"]


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return scenario.load(path)


def evaluate(*arguments):
    spec = importlib.util.spec_from_file_location("evaluate", ROOT / "agents" / "evaluate.py")
    command = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(command)
    return command.main(list(map(str, arguments)))


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_registered_arm_is_in_tables_files_and_report(own, small, tmp_path, capsys):
    pytest.importorskip("plotly")
    out, report = tmp_path / "out", tmp_path / "report.html"
    config = ("--config", tmp_path / "small.yaml", "--controller", "lqr", "--runs", 2)
    assert evaluate(*config, "--observer", "all", "--verbose", "--out", out, "--report", report) == 0
    shown = capsys.readouterr().out
    for name in own:
        assert re.search(rf" {name} ", shown.split("est. h, m")[0])  # a cell
        assert re.search(rf"LQR +{name} ", shown.split("est. h, m")[1])  # a line of the diagnostics
        assert {row["failures"] for row in rows(out / "results.csv") if row["compensation"] == name} == {"0"}
        assert len([row for row in rows(out / "runs.csv") if row["arm"] == name]) == 5
    text = report.read_text()
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    assert data["colours"]["steep"] == ["#7A5C00", "#D9B84A"]
    assert data["arms"]["held"] == "no speed"
    assert {group["arm"] for group in data["groups"]} == {*ARMS}
    assert '<option value="steep">steeper slopes</option>' in text
    assert "steep, measured" in text
    assert "#7A5C00" in text.split('id="figures">')[1]


def test_its_runs_are_those_of_its_observer(own, small):
    alone = study.measure(study.groups([small], ["lqr"], own, 2), seed=0)
    beside = study.measure(study.groups([small], ["lqr", "smc"], [*ARMS], 2), seed=0)
    same = [o for o in beside if o.group.arm in own and o.group.controller == "lqr"]
    for a, b in zip(alone, same, strict=True):
        assert a.group == b.group
        assert all(np.array_equal(values, b.metrics[name]) for name, values in a.metrics.items())
    by_arm = {name: [o for o in beside if o.group.arm == name and o.group.controller == "lqr"] for name in ARMS}
    assert all((o.metrics["estimation_rms_h"] == 0.0).all() for o in by_arm["held"])
    assert all((o.metrics["estimation_rms_h_dot"] > 0.0).all() for o in by_arm["held"])
    assert not np.array_equal(by_arm["steep"][0].metrics["mse_h"], by_arm["with"][0].metrics["mse_h"])


def test_compiled_observers_of_all_kinds_share_a_batch(own, small, monkeypatch):
    batches = []
    run = study._run
    monkeypatch.setattr(study, "_run", lambda batch, *rest: batches.append({g.arm for g in batch}) or run(batch, *rest))
    study.measure(study.groups([small], ["lqr"], [*ARMS], 1), seed=0)
    assert batches == [{"without", "with", "steep", "theorem", "oracle"}, {"held"}]


def test_scenarios_that_differ_in_their_designed_gains_each_have_their_own(small):
    more = small.designed.margin.model_copy(update={"value": 0.12})  # of the same step
    other = small.model_copy(update={"designed": small.designed.model_copy(update={"margin": more})})
    wanted = [study.groups([place], ["lqr"], ["theorem"], 1) for place in (small, other)]
    together = study.measure([*wanted[0], *wanted[1]], seed=0)
    alone = [outcome for groups in wanted for outcome in study.measure(groups, seed=0)]
    for a, b in zip(together, alone, strict=True):
        assert np.array_equal(a.metrics["estimation_rms_h_dot"], b.metrics["estimation_rms_h_dot"])
    assert not np.array_equal(alone[0].metrics["mse_h"], alone[len(wanted[0])].metrics["mse_h"])


def test_statistics_and_tables_follow_the_registry(own, small):
    outcomes = study.measure(study.groups([small], ["lqr"], ["held", "with", "steep"], 2), seed=0)
    found = dict.fromkeys(result.cell.compensation for result in statistics.results(outcomes))
    assert [*found] == ["with", "steep", "held"]
    assert [row[2] for row in tables.diagnosed(outcomes)[1]] == ["with", "steep", "held"]


def test_what_cannot_be_registered_is_named(registry):
    like = {"title": "t", "colour": "#111111", "colour_on_dark": "#EEEEEE", "observer": steep}
    for name in ("with", "smo", "all"):
        with pytest.raises(ValueError, match=f"arm '{name}' exists: take a name other than 'without', "):
            register(Arm(name, **like))
    with pytest.raises(ValueError, match="the colour #d55e00 is taken by 'without'"):
        register(Arm("own", **like | {"colour": "#d55e00"}))
    with pytest.raises(ValueError, match=r"name='<b>' must be of letters, digits, '-' and '_'"):
        Arm("<b>", **like)
    with pytest.raises(ValueError, match=r"colour_on_dark='red' must be as '#RRGGBB'"):
        Arm("own", **like | {"colour_on_dark": "red"})
    assert [*registry] == ["without", "with", "theorem", "oracle"]


def test_an_unknown_arm_is_named_with_one_that_exists(own, capsys):
    with pytest.raises(ValueError, match="unknown arm 'stepe': did you mean 'steep'"):
        arms.arm("stepe")
    assert evaluate("--observer", "stepe") == 2
    assert "unknown observer 'stepe': did you mean 'steep'?" in capsys.readouterr().err
    assert evaluate("--observer", "steep", "--compensation", "on") == 2
    assert "--compensation on is for the observer smo, not --observer steep" in capsys.readouterr().err


def test_an_observer_that_cannot_work_is_named_before_any_run(registry, small, monkeypatch):
    register(Arm("picky", "t", "#111111", "#EEEEEE", lambda settings, scenario, task: Picky()))
    monkeypatch.setattr(study, "_run", None)
    with pytest.raises(
        ValueError, match=r"arm 'picky': its observer cannot work in 'Regulation' \(TypeError: not here"
    ):
        study.measure(study.groups([small], ["lqr"], ["with", "picky"], 1), seed=0)


def test_the_articles_figures_show_the_printed_arms_alone(own):
    assert all(colours.keys() == {*arms.PRINTED} for colours in panels.COLOURS.values())
    assert arms.PRINTED == ("without", "with")
    assert page.ARMS is ARMS
