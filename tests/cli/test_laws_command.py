"""``smo-gym laws`` and ``smo-gym tune laws``: what they write, and what they refuse."""

import csv

import pytest

from smo_gym.cli import laws, tune
from smo_gym.evaluation import law_settings

COLUMNS = (
    "case,disturbed,law,observer,start,sensor,control_period,mse_h,mse_theta,iae_h,iae_theta,effort,total_variation,"
    "peak_force,failures,runs"
)
FEW = ["--case", "tracking", "--sensor", "exact", "--period", "0.02", "--observer", "ekf", "--runs", "3"]


def rows(out):
    with (out / "laws.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_has_its_columns_a_row_for_each_cell_and_a_picture(tmp_path, capsys):
    out = tmp_path / "out"
    assert laws.main([*FEW, "--law", "linear", "ism-pi", "--figure", "--report", "--out", str(out)]) == 0
    found = rows(out)
    assert (out / "laws.csv").read_text().startswith(COLUMNS)
    assert [(row["law"], row["disturbed"]) for row in found] == [
        ("linear", "no"),
        ("ism-pi", "no"),
        ("linear", "yes"),
        ("ism-pi", "yes"),
    ]
    assert all((row["runs"], row["failures"]) == ("3", "0") for row in found)
    page = (out / "laws.html").read_text()
    assert "PI on the same variable" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    assert (out / "laws.png").stat().st_size > 10_000
    assert "PI on the same variable" in capsys.readouterr().out
    again = tmp_path / "again"
    assert laws.main([*FEW, "--law", "ism-pi", "--workers", "2", "--out", str(again)]) == 0
    assert rows(again) == [row for row in found if row["law"] == "ism-pi"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--law", "magic"], "unknown law 'magic'"),
        (["--case", "table-9"], "table-9"),
        (["--sensor", "camera"], "camera"),
        (["--law", "lqg", "--case", "tracking", "--observer", "ekf", "--sensor", "camera"], "camera"),
    ],
)
def test_what_is_not_there_is_named(arguments, told, tmp_path, capsys):
    assert laws.main([*arguments, "--runs", "2", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert not (tmp_path / "out" / "laws.csv").exists()


def test_the_promise_is_kept_where_the_conditions_hold_and_not_where_one_is_broken(capsys):
    assert laws.main(["--promise", "--runs", "10"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (meets,) = (line for line in lines if line.startswith("meets"))
    (breaks,) = (line for line in lines if line.startswith("breaks"))
    assert "10 of 10" in meets
    assert " 0 of 10" in breaks
    assert "k2 > L by +" in meets
    assert "k2 > L by -" in breaks


def test_tuning_writes_settings_with_what_it_found(tmp_path, capsys):
    out = tmp_path / "out"
    assert tune.main(["laws", "--law", "lqg", "--budget", "3", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    text = (out / "laws.yaml").read_text()
    assert text.count("CMA-ES, 3 evaluations; objective ") == 3
    assert all(family in printed for family in ("regulation-filtered", "upright-filtered", "tracking-filtered"))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["--law", "magic"], "unknown law 'magic'"), (["--law", "lqr"], "nothing of it is tuned")],
)
def test_tuning_refuses_what_is_not_tuned(arguments, told, tmp_path, capsys):
    assert tune.main(["laws", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err


def test_a_front_has_the_shipped_numbers_on_it_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    """Under the family's own weight nothing is searched: those rows are the table's."""
    few = law_settings.named().model_copy(update={"budget": 2})
    monkeypatch.setattr(law_settings, "named", lambda: few)
    out = tmp_path / "front"
    assert laws.main(["--front", "--law", "linear", "--runs", "3", "--figure", "--out", str(out)]) == 0
    with (out / "front.csv").open(newline="") as file:
        found = list(csv.DictReader(file))
    assert {(row["weight"], row["case"], row["outside"]) for row in found} == {
        (weight, case, outside)
        for weight in ("0.02", "0.1", "0.5")
        for case in ("table-4", "upright")
        for outside in ("yes", "no")
    }
    place = ["--observer", "ekf", "--sensor", "noise", "--period", "0.02", "--case", "table-4"]
    assert laws.main(["--law", "linear", *place, "--runs", "3", "--out", str(tmp_path / "table")]) == 0
    (mine,) = (row for row in rows(tmp_path / "table") if row["disturbed"] == "no")
    (same,) = (r for r in found if (r["weight"], r["case"], r["outside"]) == ("0.1", "table-4", "no"))
    assert same["mse_h"] == mine["mse_h"]
    assert (out / "front.png").stat().st_size > 10_000
    assert laws.main(["--front", "--law", "lqr", "--out", str(tmp_path / "none")]) == 2
    assert "nothing of it is tuned" in capsys.readouterr().err
