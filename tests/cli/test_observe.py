"""Velocities of a log, the tuner and the table, as commands."""

import csv
import sys

import numpy as np
import pytest
import yaml

from smo_gym.evaluation.arms import ARMS
from smo_gym.recordings import logged


def log(path, turn=1.0, header="time,position,angle,u", gap=False, wrap=False):
    t = 0.002 * np.arange(1500)
    t = np.delete(t, slice(700, 703)) if gap else t
    angle = turn * 0.4 * np.cos(5.0 * t)
    if wrap:
        angle = (turn * (8.0 * t + 1.0) + turn * np.pi) % (turn * 2.0 * np.pi) - turn * np.pi
    rows = np.column_stack([t, 0.1 * np.sin(2.0 * t), angle, np.sin(t)])
    path.write_text("# a rig\n" + header + "\n" + "\n".join(",".join(f"{v!r}" for v in row) for row in rows.tolist()))
    return path


def test_estimates_of_a_log(command, tmp_path):
    path = log(tmp_path / "log.csv", gap=True)
    done = command("observe", path, "--observer", "smo-tuned", "--out", tmp_path / "out")

    assert "1497 samples, 2 ms apart, 1 gaps" in done.stdout
    with (tmp_path / "out" / "estimates.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1497
    late = rows[500:]
    speeds = np.array([[float(row["position_dot_hat"]), float(row["angle_dot_hat"])] for row in late])
    t = np.array([float(row["time"]) for row in late])
    truth = np.column_stack([0.2 * np.cos(2.0 * t), -2.0 * np.sin(5.0 * t)])
    assert np.sqrt(((speeds - truth) ** 2).mean(0)) == pytest.approx([0.0, 0.0], abs=0.3)
    assert (tmp_path / "out" / "estimates.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("made", "arguments", "said"),
    [
        ({"turn": 180.0 / np.pi}, (), "a second and more"),
        ({"turn": 180.0 / np.pi, "wrap": True}, (), "wraps at 360"),
        ({"header": "time,position,theta,u"}, (), "angle"),
        ({"header": "t,x,angle,volts"}, ("--positions", "x", "angle"), "u"),
        ({}, ("--observer", "smo-tund"), "smo-tuned"),
        ({}, ("--model", "cart"), "cart-pendulum"),
        ({}, ("--model", "{cart_mass: -1.0}"), "cart_mass=-1.0"),
        ({}, ("--set", "[1, 2]"), "mapping as YAML"),
        ({}, ("--set", "{slope: 3.0}"), "slopes"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(command, tmp_path, made, arguments, said):
    done = command(
        "observe",
        log(tmp_path / "log.csv", **made),
        "--out",
        tmp_path / "out",
        "--observer",
        "smo-tuned",
        *arguments,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_degrees_that_are_said_are_taken(tmp_path):
    path = log(tmp_path / "log.csv", turn=180.0 / np.pi)
    found = logged.read(path, ["position", "angle"], "u", degrees=True)
    assert np.abs(found.y[:, 1]).max() == pytest.approx(0.4)
    assert np.abs(logged.read(path, ["position", "angle"], "u", degrees=False).y[:, 1]).max() > 3.0


def test_an_angle_that_wraps_is_unwrapped(tmp_path):
    found = logged.read(log(tmp_path / "log.csv", wrap=True), ["position", "angle"], "u")
    assert np.diff(found.y[:, 1]) == pytest.approx(0.016)


def test_counts_of_a_turn_in_degrees_are_noticed(tmp_path):
    t = 0.02 * np.arange(400)
    angle = np.round(20.0 * np.sin(t) / (360.0 / 4096)) * (360.0 / 4096)
    path = tmp_path / "log.csv"
    path.write_text(
        "t,position,angle,u\n"
        + "\n".join(f"{a!r},0.0,{b!r},0.0" for a, b in zip(t.tolist(), angle.tolist(), strict=True))
    )
    with pytest.raises(ValueError, match="4096 to 360"):
        logged.read(path, ["position", "angle"], "u")


def test_a_line_that_is_no_number_is_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,position,angle,u\n0.0,0.0,0.0,0.0\n0.1,,0.0,0.0\n")
    with pytest.raises(ValueError, match="line 3 has ''"):
        logged.read(path, ["position", "angle"], "u")


def test_tuning_writes_settings_that_can_be_used(command, tmp_path):
    command("tune", "simulated", "--observer", "smo-tuned", "--budget", "3", "--out", tmp_path)

    written = yaml.safe_load((tmp_path / "observers-simulated.yaml").read_text())
    assert written["budget"] == 3
    assert written["observers"]["smo-tuned"]["tuned"]["source"] == "identified"
    path = log(tmp_path / "log.csv")
    tuned = ("--tuned", tmp_path / "observers-simulated.yaml", "--observer", "smo-tuned")
    command("observe", path, *tuned, "--out", tmp_path / "out")


def test_the_table_of_a_few_runs(command, tmp_path):
    given = ("--observer", "smo-tuned", "--sensor", "exact", "noise", "--runs", "2", "--out", tmp_path)
    done = command("observers", *given, "--figure", "--report")

    with (tmp_path / "observers.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 3 * 2 * 2  # sensors, levels, loops, velocities
    assert {row["loop"] for row in rows} == {"open", "closed"}
    assert "smo-tuned" in done.stdout
    assert (tmp_path / "observers.png").exists()
    page = (tmp_path / "observers.html").read_text(encoding="utf-8")
    shown = ["exact", "0.2", "open", "smo-tuned", "theta_dot"]
    (cell,) = (f"{float(row['rmse']):.2g}" for row in rows if [*row.values()][:5] == shown)
    assert f'<th scope="row">smo-tuned</th><td>{cell}</td>' in page.partition("Open loop, θ′</h2>")[2]
    assert "--figure --report" in page
    assert "<svg" in page

    command("observers", *given)
    assert not (tmp_path / "observers.html").exists()  # it was of other numbers


def test_a_report_without_its_extra_is_refused_before_any_run(command, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    done = command("observers", "--report", "--out", tmp_path / "out", check=False)
    assert done.returncode == 2
    assert 'a report needs jinja2: pip install "smo_gym[report,plots]"' in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_rigs_model_and_tuning_by_name(command, tmp_path):
    path = log(tmp_path / "log.csv")
    settings = "{substeps: 2}"
    given = ("--model", "qube", "--tuned", "qube", "--observer", "ekf", "--set", settings, "--out", tmp_path / "out")
    assert "observer ekf" in command("observe", path, *given).stdout


def test_wrong_models_are_of_recordings(command, tmp_path):
    done = command("observers", "--mismatch", "--out", tmp_path, check=False)
    assert done.returncode == 2
    assert "--data" in done.stderr
    done = command("observers", "--data", tmp_path, "--out", tmp_path / "out", check=False)
    assert done.returncode == 2
    assert "cartpole or qube" in done.stderr


@pytest.fixture
def arms_as_they_were():
    """What a command registers is of its process; here others follow."""
    before = dict(ARMS)
    yield
    ARMS.clear()
    ARMS.update(before)


@pytest.mark.usefixtures("arms_as_they_were")
def test_a_tuned_observer_is_an_arm_of_the_harness(command, tmp_path):
    given = ("--controller", "lqr", "--scenario", "regulation", "--observer", "steady-kalman", "--runs", "2")
    command("evaluate", *given, "--out", tmp_path)
    assert "steady-kalman" in (tmp_path / "runs.csv").read_text()
    done = command("evaluate", "--observer", "steady-kalmann", "--out", tmp_path, check=False)
    assert "'steady-kalman'" in done.stderr


@pytest.mark.slow
def test_processes_measure_the_same_table(command, tmp_path):
    """Also what this command measures besides the usual."""
    given = ("--observer", "levant-proper", "--sensor", "counts", "--runs", "2")
    for workers in (1, 2):
        command("observers", *given, "--workers", workers, "--out", tmp_path / str(workers))

    def rows(workers):
        with (tmp_path / str(workers) / "observers.csv").open() as file:
            return [{name: value for name, value in row.items() if name != "ns"} for row in csv.DictReader(file)]

    assert rows(1) == rows(2)
