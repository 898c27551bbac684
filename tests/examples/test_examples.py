"""What a user adds is one file each, and in the tables: the modules beside this one."""

import csv
import importlib
import re
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from conftest import SMALL

from smo_gym import ObserverWrapper, VectorObserverWrapper
from smo_gym.cli import evaluate
from smo_gym.evaluation import metrics, scenario, study
from smo_gym.evaluation.report import tables

HERE = Path(__file__).parent
NAMES = sorted(path.stem for path in HERE.glob("[!t]*.py"))


@pytest.fixture(autouse=True)
def found(registry, monkeypatch, tmp_path):
    """The modules can be imported, once more in every test, and what they register is forgotten after it."""
    meters, environments = dict(metrics.METERS), dict(gymnasium.registry)
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.chdir(tmp_path)
    yield
    for known, before in ((metrics.METERS, meters), (gymnasium.registry, environments)):
        known.clear()
        known.update(before)
    for name in NAMES:
        sys.modules.pop(name, None)


@pytest.fixture
def drivers(monkeypatch):
    """The drivers that rollouts took, one after the other."""
    module, taken = importlib.import_module("smo_gym.evaluation.rollout"), []
    for name in ("driven", "asked"):
        driver = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, name=name, driver=driver: taken.append(name) or driver(*given))
    return taken


def run(*arguments, config=SMALL):
    """The command on a short scenario: its runs, and what it printed."""
    given = ["--config", config, "--controller", "lqr", "--runs", 2, "--out", "out", *arguments]
    assert evaluate.main([*map(str, given)]) == 0
    with Path("out/runs.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows, name, **where):
    return [float(row[name]) for row in rows if all(row[key] == value for key, value in where.items())]


def config(environment):
    """The short scenario in another environment."""
    path = Path("own.yaml")
    path.write_text(f"extends: {SMALL}\nenvironment: {environment}\n")
    return path


@pytest.mark.parametrize(("name", "driver"), [("luenberger", "driven"), ("ekf", "asked")])
def test_an_observer_is_an_arm(name, driver, drivers, capsys):
    rows = run("--import", name, "--observer", name)
    assert {row["arm"] for row in rows} == {name}
    assert {row["failed"] for row in rows} == {"0"}
    assert set(drivers) == {driver}
    assert max(numbers(rows, "estimation_rms_h")) < 0.1
    assert re.search(rf"4, LQR .*\n  {name} ", capsys.readouterr().out)


def test_a_compiled_observer_gives_an_estimator_too():
    observer = importlib.import_module("luenberger").Luenberger()
    estimator = observer.start(3, 0.001, 30.0, scenario.load(SMALL).task.params)
    y = np.array([[0.1, 0.2, 0.3], [0.0, 0.1, 0.2]])
    estimator.reset(np.ones(3, dtype=np.bool_), y)
    estimator.update(np.repeat(y[None], 500, axis=0), np.zeros(3))
    assert np.abs(estimator.xhat[:2] - y).max() < 0.02


def test_a_sensor_of_ones_own_is_what_the_observer_reads(drivers):
    exact, seen = run(), run("--import", "hall_sensor", config=config("Hall-v0"))
    assert drivers == ["driven", "driven"]
    assert numbers(seen, "estimation_rms_theta") != numbers(exact, "estimation_rms_theta")
    alone, batch = gymnasium.make("Hall-v0"), gymnasium.make_vec("Hall-v0", 3)
    for env in (ObserverWrapper(alone), VectorObserverWrapper(batch)):
        _, info = env.reset(seed=0)
        for _ in range(3):
            h, theta = np.moveaxis(info["positions"], -1, 0)
            wanted = theta + 0.01 * np.sin(theta) + 0.02 * np.sin(2.0 * theta)
            np.testing.assert_allclose(info["samples"][..., 1], wanted, atol=0.5001 * 2.0 * np.pi / 4096)
            assert np.array_equal(info["samples"][..., 0], h)
            *_, info = env.step(np.full(env.action_space.shape, 5.0))


def test_friction_of_ones_own_is_a_part_of_the_loop(drivers):
    smooth, rubbing = run(), run("--import", "stribeck", config=config("Stribeck-v0"))
    assert drivers == ["driven", "driven"]
    pairs = zip(numbers(smooth, "peak_h_dot"), numbers(rubbing, "peak_h_dot"), strict=True)
    assert all(slower < faster for faster, slower in pairs)
    alone, batch = gymnasium.make("Stribeck-v0"), gymnasium.make_vec("Stribeck-v0", 3)
    alone.reset(seed=0)
    batch.reset(seed=0)
    for _ in range(5):
        x, xs = alone.step(np.array([5.0]))[4]["state"], batch.step(np.full((3, 1), 5.0))[4]["state"]
        assert np.array_equal(x, xs[0])


def test_friction_of_zero_is_the_plant_to_the_bit():
    importlib.import_module("stribeck")
    states = []
    for name, options in (("Stribeck-v0", {"breakaway": 0.0, "sliding": 0.0}), ("SMOPendulum-v0", {})):
        env = gymnasium.make_vec(name, 3, **options)
        env.reset(seed=0)
        states.append([env.step(np.full((3, 1), 5.0))[4]["state"] for _ in range(5)])
    assert np.array_equal(*states)


def test_a_law_of_a_block_runs_in_the_compiled_driver(drivers):
    rows = run("--controller", "damping:Damping")
    assert {row["controller"] for row in rows} == {"damping:Damping"}
    assert set(drivers) == {"driven"}
    assert 0.0 < max(numbers(rows, "peak_force")) < 30.0


def test_a_registered_metric_is_in_the_runs_and_the_diagnostics(capsys):
    rows = run("--import", "excursion", "--verbose")
    values = numbers(rows, "share_away")
    assert 0.0 < min(values) <= max(values) <= 100.0
    printed, written = capsys.readouterr().out, Path("out/tables.md").read_text().replace("\\", "")
    for text in (printed, written):
        assert "share_away, %" in text
        assert "share_away: share of the sampling instants with |h - h_d| > 0.5 m" in text
    mean = np.mean([float(row["share_away"]) for row in rows if row["arm"] == "with" and row["uncertainty"] != "0.0"])
    shown = [line.split() for line in printed.splitlines() if re.match(r"4 +LQR +with ", line)]
    assert f"{mean:.3g}" in shown[-1]


def test_without_registered_metrics_the_diagnostics_are_as_they_were(small):
    outcomes = study.measure(study.groups([small], ["lqr"], ["with"], 1), seed=0)
    assert tables.diagnosed(outcomes)[0][-2:] == ("peak F, N", "left the set")
