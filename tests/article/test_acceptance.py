"""What the project promises of the article's tables, on 200 random plants a cell."""

import csv
import math
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("acceptance")
    command = [sys.executable, str(ROOT / "agents" / "evaluate.py"), "--runs", "200", "--out", str(out)]
    subprocess.run(command, check=True, capture_output=True)
    with (out / "results.csv").open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["published"]]


def select(rows, table, controller, metric, average):
    return [
        row
        for row in rows
        if (row["table"], row["controller"], row["metric"]) == (table, controller, metric)
        and (row["row"] == "average") == average
    ]


def deviations(rows):
    return np.array([math.log(float(row["measured"]) / float(row["published"])) for row in rows])


def test_table_5_lqr(rows):
    off = deviations(select(rows, "5", "lqr", "mse", average=False))
    assert off.size == 16
    assert np.abs(np.expm1(off)).max() <= 0.10
    assert np.sqrt(np.mean(off**2)) <= 0.04


def test_table_5_smc(rows):
    off = deviations(select(rows, "5", "smc", "mse", average=False))
    assert off.size == 16
    assert np.abs(np.expm1(off)).max() <= 0.25
    assert np.sqrt(np.mean(off**2)) <= 0.08


@pytest.mark.parametrize("controller", ["lqr", "smc"])
def test_table_4_averages_and_reductions(rows, controller):
    averages = deviations(select(rows, "4", controller, "mse", average=True))
    assert averages.size == 4
    assert np.abs(np.expm1(averages)).max() <= 0.10
    reductions = select(rows, "4", controller, "mse_reduction_percent", average=True)
    assert len(reductions) == 2
    assert all(abs(float(row["measured"]) - float(row["published"])) <= 5.0 for row in reductions)


def test_table_7_averages_and_reductions(rows):
    averages = deviations(select(rows, "7", "smc-tracking", "mse", average=True))
    assert averages.size == 4
    assert np.abs(np.expm1(averages)).max() <= 0.12
    reductions = select(rows, "7", "smc-tracking", "mse_reduction_percent", average=True)
    assert len(reductions) == 2
    assert all(abs(float(row["measured"]) - float(row["published"])) <= 5.0 for row in reductions)


def test_no_run_fails(rows):
    assert all(row["failures"] == "0" for row in rows)
