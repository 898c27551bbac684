"""The command line, as a user calls it."""

import csv
import json
import os
import subprocess
import sys
from functools import partial

import pytest
import yaml
from conftest import ROOT

from smo_gym.evaluation import configs

EVALUATE = ROOT / "agents" / "evaluate.py"


@pytest.fixture
def evaluate(command):
    return partial(command, "evaluate")


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def published_cells(rows, controller, table):
    return [
        row
        for row in rows
        if row["metric"] == "mse"
        and row["published"]
        and row["row"] == "cell"
        and (row["controller"], row["table"]) == (controller, table)
    ]


@pytest.fixture(scope="module")
def both_tables(tmp_path_factory):
    """All tables for both controllers with the default 10 runs."""
    out = tmp_path_factory.mktemp("both")
    options = ["--controller", "all", "--scenario", "all", "--verbose", "--out", str(out)]
    done = subprocess.run([sys.executable, str(EVALUATE), *options], check=True, capture_output=True, text=True)
    return done.stdout, read(out / "results.csv"), out


@pytest.mark.slow
def test_all_published_cells_are_measured(both_tables):
    text, rows, _ = both_tables
    for controller in ("lqr", "smc"):
        assert len(published_cells(rows, controller, "4")) == 24
        assert len(published_cells(rows, controller, "5")) == 16
        for table in ("4", "5"):
            assert f"Table {table}, {controller.upper()}" in text
    assert len(published_cells(rows, "smc-tracking", "7")) == 24
    assert "104 published MSE cells in all" in text
    assert all(row["measured"] for row in rows)
    assert {row["uncertainty_percent"] for row in rows if row["table"] == "4"} == {
        *["0", "5", "7", "10", "15", "18", "20"],
        "",  # the averages
    }


@pytest.mark.slow
def test_columns_begin_with_those_of_the_published_data(both_tables):
    _, rows, _ = both_tables
    published = read(ROOT / "smo_gym" / "article" / "published.csv")
    keys = [*published[0]][:-1]
    assert [*rows[0]][: len(keys)] == keys
    assert [*rows[0]][len(keys) :] == [
        *["published", "measured", "ci_low", "ci_high", "runs", "failures", "median"],
        "row",
    ]
    ours = {(*(row[key] for key in keys), row["row"]): row["published"] for row in rows}
    for row in published:
        kind = "average" if "average" in row.values() else "cell"
        if row["table"] in "457":
            place = ("" if row[key] == "average" else row[key] for key in keys)
            assert float(ours[(*place, kind)]) == float(row["value"])


@pytest.mark.slow
def test_lqr_cells_of_table_5_are_within_ten_percent(both_tables):
    _, rows, _ = both_tables
    ratios = [float(row["measured"]) / float(row["published"]) for row in published_cells(rows, "lqr", "5")]
    assert len(ratios) == 16
    assert all(abs(ratio - 1) < 0.1 for ratio in ratios)


@pytest.mark.slow
def test_everything_that_was_promised_is_written(both_tables):
    _, _rows, out = both_tables
    assert {path.name for path in out.iterdir()} == {
        "results.csv",
        "runs.csv",
        "tables.md",
        "tables.tex",
        "settings.yaml",
        "reference.json",
    }
    assert "| average" in (out / "tables.md").read_text()
    assert r"\toprule" in (out / "tables.tex").read_text()
    settings = yaml.safe_load((out / "settings.yaml").read_text())
    assert settings["command"]["runs"] == 10
    assert settings["scenarios"][1]["controllers"]["smc"]["Z0"] == {
        "value": 26.0,
        "source": "printed",
        "note": "Table 6",
    }
    runs = read(out / "runs.csv")
    assert len(runs) == 2 * 2 * (6 * 10 + 1 + 4 * (10 + 1) + 6 * 10 + 1)
    assert not any(int(run["failed"]) for run in runs)


def test_one_seed_gives_one_result(evaluate, tmp_path):
    config = small_scenario(tmp_path, horizon={"value": 1.0, "source": "chosen"})
    arguments = ("--controller", "smc", "--config", config, "--runs", "2", "--seed", "5")
    for name in ("a", "b"):
        evaluate(*arguments, "--out", tmp_path / name)
    assert (tmp_path / "a" / "results.csv").read_bytes() == (tmp_path / "b" / "results.csv").read_bytes()
    evaluate(*arguments[:-1], "6", "--out", tmp_path / "b")
    assert (tmp_path / "a" / "results.csv").read_bytes() != (tmp_path / "b" / "results.csv").read_bytes()


def small_scenario(tmp_path, **changes):
    text = configs.path("initial-conditions").read_text()
    data = yaml.safe_load(text) | {"extends": "article"} | changes
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_options_choose_arms_levels_and_files(evaluate, tmp_path):
    config = small_scenario(tmp_path, horizon={"value": 0.5, "source": "chosen"})
    options = ("--uncertainty", "20%", "0.1", "--runs", "3", "--controller", "lqr", "--verbose")
    done = evaluate("--config", config, *options, "--observer", "oracle", "--out", tmp_path / "new" / "deep")
    rows = read(tmp_path / "new" / "deep" / "results.csv")
    assert {row["compensation"] for row in rows} == {"oracle"}
    assert {row["uncertainty_percent"] for row in rows if row["case"] == "1"} == {"0", "10", "20"}
    assert "No published cell to compare with" in done.stdout
    evaluate("--config", config, *options, "--compensation", "on", "--observer", "all", "--out", tmp_path / "b")
    assert {row["compensation"] for row in read(tmp_path / "b" / "results.csv")} == {"oracle", "theorem", "with"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--observer", "oracle", "--compensation", "on"), "--compensation on is for the observer smo"),
        (("--scenario", "tracking", "--config", "own.yaml"), "give one of them"),
    ],
)
def test_options_that_contradict_each_other_are_named(evaluate, tmp_path, options, message):
    done = evaluate(*options, check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr


def test_failed_runs_are_shown(evaluate, tmp_path):
    config = small_scenario(
        tmp_path, horizon={"value": 3.0, "source": "chosen"}, track_limit={"value": 0.9, "source": "chosen"}
    )
    done = evaluate("--config", config, "--runs", "3", "--controller", "lqr", "--out", tmp_path / "out")
    rows = read(tmp_path / "out" / "results.csv")
    case_1 = [row for row in rows if row["case"] == "1" and row["metric"] == "mse"]
    case_2 = [row for row in rows if row["case"] == "2" and row["metric"] == "mse"]
    assert all(row["failures"] == row["runs"] and row["measured"] == "" for row in case_1)
    assert all(row["failures"] == "0" and row["measured"] for row in case_2)
    assert "3 of 3" in (tmp_path / "out" / "tables.md").read_text()
    assert "16 of 32 runs failed and are in no average: Table 5, LQR: without 8 of 16, with 8 of 16." in " ".join(
        done.stdout.split()
    )


def test_the_theorems_gains_are_an_arm_of_their_own(evaluate, tmp_path):
    config = small_scenario(tmp_path, horizon={"value": 2.0, "source": "chosen"})
    options = ("--config", config, "--controller", "lqr", "--runs", "2", "--compensation", "on")
    evaluate(*options, "--observer", "all", "--out", tmp_path / "out")
    runs = [run for run in read(tmp_path / "out" / "runs.csv") if run["uncertainty"] != "0.0"]
    error = {
        arm: sum(float(run["estimation_rms_h"]) for run in runs if run["arm"] == arm)
        for arm in ("with", "theorem", "oracle")
    }
    assert error["oracle"] == 0.0
    assert 0.0 < error["theorem"] < 0.5 * error["with"]
    assert "0 of 8" in (tmp_path / "out" / "tables.md").read_text()  # in the column of those that left the set
    tight = yaml.safe_load(configs.path("article").read_text())["designed"]
    tight["operating_set"]["speed"]["value"] = [0.1, 0.1]
    config = small_scenario(tmp_path, horizon={"value": 0.5, "source": "chosen"}, designed=tight)
    done = evaluate(
        "--config", config, "--controller", "lqr", "--runs", "2", "--observer", "theorem", "--verbose", cwd=tmp_path
    )
    assert "8 of 8" in done.stdout
    without = small_scenario(tmp_path, designed=None)
    done = evaluate("--config", without, "--observer", "theorem", check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert "has no setting 'designed'" in done.stderr


def test_falls_of_the_upright_plant_are_counted(command, tmp_path):
    config = yaml.safe_load(configs.path("upright").read_text())
    config["horizon"]["value"] = 3.0
    config["uncertainty"]["value"] = [0.2]
    config["initial_states"]["value"] = {"near": [0.0, 0.05, 0.0, 0.0], "far": [0.0, 1.2, 0.0, 0.0]}
    (tmp_path / "upright.yaml").write_text(yaml.safe_dump(config))
    lines = command("upright", "--config", tmp_path / "upright.yaml", "--runs", "20").stdout.splitlines()
    near, far = (next(line for line in lines if line.startswith(case)) for case in ("near", "far"))
    assert near.count("0.0 [0.0, 16.1]") == 4
    assert far.count("100.0 [83.9,") >= 2


def test_the_article_is_checked_against_itself(command):
    assert "133 of 138 printed numbers follow from the printed cells" in command("consistency").stdout


@pytest.mark.slow
def test_the_shipped_reference_is_what_its_command_computes(command, tmp_path):
    pytest.importorskip("casadi")
    options = ["--out", tmp_path / "reference.json"]
    command("reference", *options)
    ours = json.loads((ROOT / "smo_gym" / "article" / "reference.json").read_text())
    again = json.loads((tmp_path / "reference.json").read_text())
    assert again["cost"] == pytest.approx(ours["cost"], rel=1e-9)
    assert again["u"] == pytest.approx(ours["u"], abs=1e-5)
    bad = command("reference", *options, "--horizon", "0.2", check=False)
    assert bad.returncode == 2
    assert "IPOPT says" in bad.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--controller", "LQG"], "unknown controller 'LQG': did you mean 'lqr'?"),
        (["--scenario", "regulaton"], "unknown scenario 'regulaton': did you mean 'regulation'?"),
        (["--observer", "oracel"], "did you mean 'oracle'?"),
        (["--runs", "0"], "'0' must be a whole number of at least 1"),
        (["--uncertainty", "1"], "'1' must be a fraction in [0, 1) such as 0.05, or a percentage such as 5%"),
        (["--uncertainty", "5"], "or a percentage such as 5%"),
        (["--config", "none.yaml"], "none.yaml: cannot be read"),
        (["--run", "3"], "unrecognized arguments: --run"),
    ],
)
def test_bad_arguments_are_named_before_any_work(evaluate, tmp_path, arguments, message):
    done = evaluate(*arguments, "--out", tmp_path / "out", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_config_typo_is_named(evaluate, tmp_path):
    path = small_scenario(tmp_path, horizn={"value": 1.0, "source": "chosen"})
    done = evaluate("--config", path, check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert "did you mean 'horizon'?" in done.stderr


def test_an_unwritable_folder_is_noticed_before_the_work(evaluate, tmp_path):
    (tmp_path / "file").write_text("")
    done = evaluate("--out", tmp_path / "file" / "out", "--runs", "100000", check=False)
    assert done.returncode == 2
    assert "cannot be written to" in done.stderr


@pytest.mark.skipif(os.name != "posix", reason="needs a signal")
def test_an_interruption_is_said_and_leaves_old_results(tmp_path):
    import signal

    out = tmp_path / "out"
    out.mkdir()
    (out / "results.csv").write_text("old")
    command = [sys.executable, str(EVALUATE), "--runs", "2000", "--out", str(out)]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a parent may ignore it
    )
    assert process.stderr.readline() == "128024 runs to do\n"
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert "interrupted, nothing was written" in stderr
    assert (out / "results.csv").read_text() == "old"
