"""What the main command shows on a console, of any kind."""

import os
import re
import subprocess
import sys

import pytest
import yaml
from conftest import ROOT

from smo_gym.evaluation import configs


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """What the command prints, with the environment changed, as bytes."""
    out = tmp_path_factory.mktemp("out")

    def run(*options, **environment):
        kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "NO_COLOR", "FORCE_COLOR")}
        command = [sys.executable, str(ROOT / "agents" / "evaluate.py"), "--out", str(out), *options]
        return subprocess.run(command, check=True, capture_output=True, env=kept | environment).stdout

    run.out = out
    return run


@pytest.mark.parametrize("options", [(), ("--observer", "all")])
def test_the_command_answers_on_one_screen(shown, options):
    text = shown("--controller", "all", "--scenario", "all", "--runs", "2", *options).decode("ascii")
    lines = text.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines[:-1])) <= 100  # the last has the path of --out
    assert "\x1b" not in text
    for name in ("4, LQR", "4, SMC", "5, LQR", "5, SMC", "7, SMC-TRACKING"):
        assert re.search(rf"^{name} +(-\d+\.\d %\s+){{4}}\d+ of \d+ +x [\d.]+$", text, re.MULTILINE), name
    assert re.search(r"^Compensation lowers the average MSE of h by ", text, re.MULTILINE)
    assert re.fullmatch(rf"\d+ runs in [\d.]+ s; results are in {shown.out}: tables.md has every cell", lines[-1])


def test_on_eighty_columns_no_name_and_no_number_is_cut(shown):
    text = shown("--scenario", "tracking", "--runs", "11", COLUMNS="80", PYTHONIOENCODING="ascii").decode("ascii")
    table, _, rest = text.partition("Compensation ")
    assert max(map(len, table.splitlines())) <= 80
    assert re.search(r"^7, SMC-TRACKING +(-\d+\.\d % +){4}\d+ of 24 +\d+\.\d +x [\d.]+$", table, re.MULTILINE)
    assert max(map(len, rest.splitlines()[:-1])) <= 80


def test_colours_follow_the_environment(shown):
    options = ("--scenario", "regulation", "--controller", "lqr", "--runs", "1")
    coloured = shown(*options, FORCE_COLOR="1", TERM="xterm-256color").decode()
    assert "\x1b[32m" in coloured
    assert "\x1b[3" not in shown(*options, FORCE_COLOR="1", NO_COLOR="1", TERM="xterm-256color").decode()
    plain = shown(*options).decode()
    assert re.sub(r"\x1b\[[\d;]*m", "", coloured).splitlines()[:-1] == plain.splitlines()[:-1]


def test_verbose_has_every_table_and_the_files_have_its_sentences(shown):
    text = shown("--scenario", "regulation", "--runs", "3", "--verbose").decode()
    for title in (
        "Table 4, LQR\n====",
        "Table 4, SMC\n====",
        "Diagnostics: RMS errors",
        "Diagnostics: effort and variation of the force",
        "Diagnostics: peaks",
    ):
        assert title in text
    assert len(re.findall("Reduction of the MSE by the compensation", text)) == 2
    assert max(map(len, text.splitlines()[:-1])) <= 100
    written = " ".join((shown.out / "tables.md").read_text().replace("\\", "").split())
    settings = yaml.safe_load((shown.out / "settings.yaml").read_text())
    assert "verbose" not in settings["command"]
    for start in ("48 published MSE cells in all", "Compensation lowers", "Within 10 % of the published are"):
        (sentence,) = re.findall(rf"^{start}[^|=]*?\.$", text, re.MULTILINE)
        assert " ".join(sentence.split()) in written


@pytest.mark.parametrize(
    ("options", "wanted", "unwanted"),
    [
        (("--observer", "oracle"), r"  oracle +0\.\d+ +0\.\d+ +\d", "published$|Compensation"),
        (("--compensation", "on"), r"  with +0\.\d+ +0\.\d+ +0\.\d+ +0\.\d+ +\d of 8", "Compensation|without"),
        (("--uncertainty", "12%", "13%"), "Nothing is published", "cells"),
        (("--uncertainty", "0"), r"  with +0\.", "times the effort"),
    ],
)
def test_what_there_is_not_has_no_column_and_no_sentence(command, tmp_path, options, wanted, unwanted):
    config = yaml.safe_load(configs.path("initial-conditions").read_text()) | {"extends": "article"}
    config["horizon"] = {"value": 1.0, "source": "chosen"}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(config))
    text = command(
        "evaluate", "--config", "own.yaml", "--controller", "lqr", "--runs", "1", *options, cwd=tmp_path
    ).stdout
    assert re.search(wanted, text)
    assert not re.search(unwanted, text)
    assert "nan" not in text


def test_when_every_run_fails_it_is_said(command, tmp_path):
    config = yaml.safe_load(configs.path("initial-conditions").read_text()) | {"extends": "article"}
    config["track_limit"] = {"value": 0.01, "source": "chosen"}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(config))
    options = ("--config", "own.yaml", "--controller", "lqr", "--runs", "1")
    text = command("evaluate", *options, cwd=tmp_path).stdout
    assert "16 of 16 runs failed and are in no average" in " ".join(text.split())
    assert "0 of 16" in text
    assert "nan" not in text
