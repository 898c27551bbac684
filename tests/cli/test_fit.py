"""A rig's numbers from its recordings, as a command: those of twins are found, and what cannot be is one line."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import yaml

from smo_gym.recordings import CART_POLE, QUBE, Recording, twins
from smo_gym.recordings.fitting import numbers

MODULE = """
from dataclasses import replace
from smo_gym.recordings import CART_POLE, QUBE

EXACT = replace(CART_POLE, corrected=QUBE.corrected)  # the pole on an encoder
RIG = replace(EXACT.of([1.1 * each for each in EXACT.model.params]), acceleration=(0.2, 0.2))
UNBIASED = EXACT.of([*EXACT.model.params[:8], 0.0])
"""
N = 230
TRUE = replace(CART_POLE, corrected=QUBE.corrected)


def saved(folder, runs, push=0.8, rig=TRUE):
    """Twins of swings as files."""
    folder.mkdir()
    for run in range(runs):
        t = rig.period * np.arange(N)
        u = push * np.sign(np.sin((3.0 + run) * t + run))
        still = Recording("", t, np.full((N, 2), [0.0, np.pi]), u, np.zeros(N, dtype=bool))
        made, _ = twins.twin(rig, still, run)
        rows = np.column_stack([made.t, made.y, made.u]).tolist()
        lines = [",".join(rig.columns), *(",".join(map(repr, row)) for row in rows)]
        (folder / f"run-{run}.csv").write_text("\n".join(lines))
    return folder


@pytest.fixture(scope="module")
def swings(tmp_path_factory):
    return saved(tmp_path_factory.mktemp("data") / "swings", 4)


@pytest.fixture(autouse=True)
def _own(tmp_path, monkeypatch):
    (tmp_path / "fitted_rig.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)


def test_the_numbers_of_twins_are_found_within_their_errors(command, swings, tmp_path):
    done = command("fit", "fitted_rig:RIG", "--data", swings, "--out", tmp_path / "out")

    assert f"recordings: 4, samples: {4 * N}" in done.stdout
    told = yaml.safe_load((tmp_path / "out" / "fit.yaml").read_text())
    assert (told["rig"], told["recordings"], told["samples"]) == ("cartpole", 4, 4 * N)
    assert told["loss"] < told["shipped_loss"]
    assert [*told["numbers"]] == [*numbers(TRUE)]
    for name, truth in zip(TRUE.numbers, TRUE.model.params, strict=True):
        of = told["numbers"][name]
        assert of["shipped"] == pytest.approx(1.1 * truth)
        assert abs(of["value"] - truth) < 3.0 * of["error"], name
    assert told["numbers"]["a"]["error"] < 0.01 * told["numbers"]["a"]["value"]
    held = told["numbers"]["noise h"]
    assert held == {"value": TRUE.noise[0], "error": None, "shipped": TRUE.noise[0]}


def test_observers_on_twins_of_what_was_found(command, swings, tmp_path):
    others = [name for name in numbers(TRUE) if name != "a"]
    arguments = ("fitted_rig:EXACT", "--data", swings, "--out", tmp_path / "out", "--hold", *others)
    done = command("fit", *arguments, "--twin", "kalman-ca", "backward-difference")
    with (tmp_path / "out" / "twins.csv").open() as file:
        rows = {(row["observer"], row["channel"]): float(row["rmse"]) for row in csv.DictReader(file)}
    assert len(rows) == 4
    assert rows["kalman-ca", "theta_dot"] < 0.8 * rows["backward-difference", "theta_dot"]
    assert "RMS errors on twins" in done.stdout
    command("fit", *arguments)
    assert [path.name for path in (tmp_path / "out").glob("[!.]*")] == ["fit.yaml"]  # of one run


def test_a_fit_that_does_not_converge_writes_nothing(command, tmp_path):
    data = saved(tmp_path / "data", 1, push=0.0, rig=TRUE.of([*TRUE.model.params[:8], 0.0]))
    arguments = ("fit", "fitted_rig:UNBIASED", "--data", data, "--rounds", "1", "--out", tmp_path / "out")
    done = command(*arguments, "--hold", "u0", check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "the log-likelihood is flat, most of all along 'c'" in line
    assert "hold what these recordings do not tell apart (noise h, u0, c)" in line
    assert not [*(tmp_path / "out").glob("[!.]*")]
    command(*arguments, "--hold", "u0", "c")


@pytest.mark.parametrize(
    ("rig", "arguments", "said"),
    [
        ("cartpol", (), "unknown rig 'cartpol': did you mean 'cartpole'?"),
        ("fitted_rig:CART", (), "fitted_rig:CART: must name a smo_gym.recordings.Rig"),
        ("qube", (), "unknown column 't'"),
        ("cartpole", ("--hold", "noise x"), "unknown number 'noise x'"),
        ("cartpole", ("--twin", "efk"), "unknown observer 'efk'"),
        ("cartpole", ("--seconds", "1.0", "1.1"), "run-0: has 5 samples, a fit wants more than 6"),
        ("cartpole", ("--seconds", "9", "10"), "run-0: has 0 samples, a fit wants more than 6"),
        ("cartpole", ("--hold", *numbers(TRUE)), "0 numbers, 1792 measurements"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(command, swings, tmp_path, rig, arguments, said):
    done = command("fit", rig, "--data", swings, "--out", tmp_path / "out", *arguments, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert said in line
    assert not [*(tmp_path / "out").glob("[!.]*")]


def test_nothing_is_used_of_a_folder_that_is_not_what_its_index_says(command, tmp_path):
    (tmp_path / "data" / "cartpole").mkdir(parents=True)
    saved(tmp_path / "data" / "cartpole" / "train", 1)
    data = tmp_path / "data"
    (data / "index.csv").write_text(f"file,sha256\ncartpole/train/run-0.csv,{'0' * 64}\n")
    for place, said in ((data, "is not the file that index.csv names"), (tmp_path / "nowhere", "has no recordings of")):
        done = command("fit", "cartpole", "--data", place, "--out", tmp_path / "out", check=False)
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert said in line
        assert not (tmp_path / "out").exists()
