"""smo-gym settle: what it refuses, and what it writes."""

import csv
import re

import pytest
import yaml
from conftest import ROOT

from smo_gym.cli import settle
from smo_gym.evaluation import evidence, settled, settling_search
from smo_gym.evaluation.settled import Settled


@pytest.mark.parametrize("bad", [["--runs", "0"], ["--serch"], ["--seed", "-1"]])
def test_bad_arguments_are_one_line(bad, tmp_path, capsys):
    assert settle.main([*bad, "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith("smo-gym settle: error: ")
    assert not (tmp_path / "out").exists()


def test_a_search_writes_settings_that_can_be_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(settling_search, "COLUMNS", settling_search.COLUMNS[-1:])
    monkeypatch.setattr(settling_search, "TRAINED", settling_search.TRAINED[-1:])
    for name, few in (("PLANTS", 2), ("BUDGET", 2), ("CONSTANTS", settling_search.CONSTANTS[:2])):
        monkeypatch.setattr(settling_search, name, few)
    assert settle.main(["--search", "--out", str(tmp_path)]) == 0
    found = Settled.model_validate(yaml.safe_load((tmp_path / "settle.yaml").read_text()))
    assert found.budget == 2
    assert found.tuned["tracking"]["smc"]["measured"].beta_2.source == "identified"
    assert f"settle.yaml is in {tmp_path}" in capsys.readouterr().out
    assert settled.ours().budget == 80


@pytest.mark.slow
def test_it_writes_all_and_prints_all(tmp_path, monkeypatch, capsys):
    for name, few in (("RUNS", 2), ("SWEPT", 3), ("SLIDING", 3)):
        monkeypatch.setattr(evidence, name, few)
    assert settle.main(["--runs", "2", "--out", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {*settle.RESULTS}
    lines = [*csv.DictReader((tmp_path / "claims.csv").read_text().splitlines())]
    places = {re.sub(r",.*", "", line["place"]) for line in lines}
    wanted = {"Abstract", "Theorem 1", "Theorem 2", "Property 1", "Property 2", "Assumption 1", "Assumption 2"}
    wanted |= {f"Remark {i}" for i in range(1, 9)} | {f"Contribution {i}" for i in (1, 2, 3)}
    assert places == wanted | {f"Conclusion {i}" for i in range(1, 6)}
    assert {line["verdict"] for line in lines} <= {"holds", "fails", "undecided"}
    assert all(line["number"] and line["command"].startswith("smo-gym ") for line in lines)
    page = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8").replace("\\", "")
    assert all(f"| {line['place']} | {line['claim'].partition(' (')[0]}" in page for line in lines)
    shown = capsys.readouterr().out
    *tables, where = shown.splitlines()
    assert max(map(len, tables)) <= 100
    assert where.endswith(f"are in {tmp_path}")
    assert f"Of {len(lines)} statements: " in shown
    arms = [*csv.DictReader((tmp_path / "settle.csv").read_text().splitlines())]
    assert len(arms) == 10 * 7
