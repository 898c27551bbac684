"""Which files are taken, and how they are put together."""

import numpy as np
import pytest
from conftest import ROOT

from smo_gym.recordings import CART_POLE, RIGS, load
from smo_gym.recordings.loading import holds

DATA = ROOT.parent / "shared" / "data"
PERIOD = CART_POLE.period
CODE = 2.0 * np.pi / 4096.0
COLUMNS = ("time", "angle", "position", "Q")


def written(path, header=COLUMNS, **changes):
    k = np.arange(120)
    columns = {"time": 50.0 + PERIOD * k, "angle": 3.0 * np.sin(0.05 * k), "position": 1e-3 * k, "Q": np.cos(k)}
    columns |= changes
    rows = np.column_stack([columns[name.strip()] for name in header]).tolist()
    path.write_text("\n".join(["# saved", ",".join(header), *(",".join(map(repr, row)) for row in rows)]))
    return path


def test_a_file_is_taken_alone(tmp_path):
    (found,) = load(CART_POLE, written(tmp_path / "mine.csv"))
    assert found.name == "mine"


def test_a_rig_is_known_by_its_folder_or_by_its_columns(tmp_path):
    mine = written(tmp_path / "mine.csv")
    (tmp_path / "index.csv").write_text("file,sha256\n")  # the first by name, and no recording
    for place in (tmp_path, mine):
        assert [name for name, rig in RIGS.items() if holds(rig, place)] == ["cartpole"]
    (tmp_path / "qube").mkdir()
    assert holds(RIGS["qube"], tmp_path)
    assert not holds(CART_POLE, tmp_path / "qube")
    assert not holds(CART_POLE, tmp_path / "nowhere")


def test_columns_go_by_name(tmp_path):
    one, other = written(tmp_path / "a.csv"), written(tmp_path / "b.csv", ("Q", " position", "time", " angle"))
    a, b = load(CART_POLE, one)[0], load(CART_POLE, other)[0]
    for field in ("t", "y", "u", "fault"):
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field))


def test_runs_are_in_the_order_of_their_numbers(tmp_path):
    for number in (10, 9, 100):
        written(tmp_path / f"run-{number}.csv")
    assert [run.name for run in load(CART_POLE, tmp_path)] == ["run-9", "run-10", "run-100"]


def test_samples_that_are_too_near_are_named(tmp_path):
    time = 50.0 + PERIOD * np.arange(120)
    time[60] -= 0.7 * PERIOD
    with pytest.raises(ValueError, match=r"a\.csv: sample 60 comes 0\.006087 s after .* where 0\.02029 s are usual"):
        load(CART_POLE, written(tmp_path / "a.csv", time=time))


def test_few_degrees_are_known_by_their_steps(tmp_path):
    balancing = np.degrees(CODE) * np.round(5.0 * np.sin(np.arange(120)))
    assert np.abs(balancing).max() < 1.0
    with pytest.raises(ValueError, match="steps of 0.08789, 4096 to 360: is it in degrees"):
        load(CART_POLE, written(tmp_path / "a.csv", angle=balancing))
    load(CART_POLE, written(tmp_path / "b.csv", angle=np.radians(balancing)))


@pytest.mark.skipif(not DATA.is_dir(), reason="wants the recordings of real machines beside the repository")
def test_the_recordings_are_all_there_and_regular():
    runs = {(name, split): load(rig, DATA, split) for name, rig in RIGS.items() for split in ("train", "test")}
    assert [*map(len, runs.values())] == [60, 30, 6, 6]
    for (name, _), recordings in runs.items():
        steps = [step for run in recordings for step in np.diff(run.t) / RIGS[name].period]
        gaps = [step for step in steps if step > 1.5]
        assert steps == pytest.approx(np.round(steps), abs=1e-9)
        assert {*np.round(gaps)} <= {2.0}
    cart = runs["cartpole", "train"] + runs["cartpole", "test"]
    assert sum((np.diff(run.t) > 1.5 * PERIOD).sum() for run in cart) == 38
