"""Recordings of real rigs: how they are read, what is refused, references and scores."""

import hashlib

import numpy as np
import pytest
from conftest import ROOT

from smo_gym.evaluation import candidates, on_recordings, real_sweeps
from smo_gym.observers import SlidingModeObserver
from smo_gym.recordings import CART_POLE, QUBE, Recording, load, scoring, smoothing
from smo_gym.recordings.cartpole import corrected

DATA = ROOT.parent / "shared" / "data"
there = pytest.mark.skipif(not DATA.is_dir(), reason="no recordings beside this checkout")
PERIOD = CART_POLE.period


def written(folder, name="Experiment-1.csv", change=lambda rows: rows, header="time,angle,position,Q"):
    folder.mkdir(parents=True, exist_ok=True)
    t = 100.0 + PERIOD * np.arange(60) + 1e-4 * np.sin(np.arange(60.0))
    rows = np.column_stack([t, 0.5 * np.sin(3.0 * t), 0.1 * np.cos(t), 0.3 * np.sin(t)])
    path = folder / name
    lines = [",".join(map(repr, row)) for row in change(rows).tolist()]
    path.write_text("\n".join(["# saved by a rig", header, *lines]))
    return path


def test_stamps_jitter_and_the_grid_does_not(tmp_path):
    written(tmp_path, change=lambda rows: np.delete(rows, 30, axis=0))
    (found,) = load(CART_POLE, tmp_path)
    steps = np.diff(found.t) / PERIOD
    assert steps == pytest.approx(np.round(steps), abs=1e-9)
    assert sorted({*np.round(steps)}) == [1.0, 2.0]


def test_a_rig_of_another_period_keeps_its_own(tmp_path):
    def faster(rows):
        rows[:, 0] = 100.0 + 0.005 * np.arange(len(rows))
        return rows

    written(tmp_path, change=faster)
    assert np.diff(load(CART_POLE, tmp_path)[0].t) == pytest.approx(0.005)


def test_the_potentiometer_makes_up_for_its_scale_once_a_turn():
    reading = np.linspace(0.0, 3.0 * 2.0 * np.pi, 4000)
    angle, fault = corrected(reading)
    jumps = np.diff(angle) > 0.1
    assert jumps.sum() == 3
    assert np.diff(angle)[jumps] == pytest.approx(0.04 * 2.0 * np.pi, abs=0.01)
    assert angle[-1] - angle[0] == pytest.approx(reading[-1])
    assert fault.any()
    assert not fault[np.abs(reading - 3.0) < 1.0].any()


def test_an_input_that_arrives_late_is_the_mean_of_two(tmp_path):
    t = 0.002 * np.arange(40)
    rows = np.column_stack([t, 0.0 * t, 0.01 * np.sin(t), t])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    (tmp_path / "a.csv").write_text("\n".join(["t, theta, alpha, plant_input", *lines]))
    (found,) = load(QUBE, tmp_path)
    assert found.u[5] == pytest.approx(0.4 * t[5] + 0.6 * t[4])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"change": lambda rows: rows[::-1]}, "time runs backwards at sample 1"),
        ({"change": lambda rows: rows[:1]}, "has 1 sample"),
        ({"change": lambda rows: np.where(np.arange(60)[:, None] == 7, np.nan, rows)}, "is not finite"),
        ({"header": "time,angel,position,Q"}, "angle"),
        ({"change": lambda rows: rows * [1.0, 180.0 / np.pi, 1.0, 1.0]}, "degrees"),
    ],
)
def test_what_cannot_be_is_named_with_its_file(tmp_path, change, said):
    path = written(tmp_path, **change)
    with pytest.raises(ValueError, match=said) as error:
        load(CART_POLE, tmp_path)
    assert str(path) in str(error.value)


def test_a_file_that_is_not_the_one_of_the_index_is_refused(tmp_path):
    path = written(tmp_path / "cartpole" / "test")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    (tmp_path / "index.csv").write_text(f"file,sha256\ncartpole/test/Experiment-1.csv,{digest}\n")
    assert len(load(CART_POLE, tmp_path)) == 1
    other = tmp_path / "other"
    path = written(other / "cartpole" / "test")
    (other / "index.csv").write_text(f"file,sha256\ncartpole/test/Experiment-1.csv,{'0' * 64}\n")
    with pytest.raises(ValueError, match="is not the file that index.csv names"):
        load(CART_POLE, other)
    assert len(load(CART_POLE, other, checked=False)) == 1
    with pytest.raises(ValueError, match="has no recordings"):
        load(CART_POLE, tmp_path / "nowhere")


@pytest.fixture(scope="module")
def twin():
    """A recording whose truth is known: the model itself, with noise."""
    rng = np.random.default_rng(0)
    n, model = 200, CART_POLE.model
    u = 0.6 * np.sin(2.0 * PERIOD * np.arange(n))
    x = np.empty((n, 4))
    x[0] = 0.0, 3.0, 0.0, 0.0
    for k in range(n - 1):
        z, h = x[k], PERIOD / 4
        for _ in range(4):
            a = model.rate(z, u[k])
            b = model.rate(z + 0.5 * h * a, u[k])
            c = model.rate(z + 0.5 * h * b, u[k])
            z = z + h / 6.0 * (a + 2.0 * (b + c) + model.rate(z + h * c, u[k]))
        x[k + 1] = z
    y = x[:, :2] + rng.normal(size=(n, 2)) * CART_POLE.noise
    fault = np.zeros(n, dtype=bool)
    fault[100:103] = True
    y[100:103, 1] += 0.2
    return x, Recording("twin", PERIOD * np.arange(n), y, u, fault)


def test_the_smoother_finds_the_truth_and_skips_the_fault(twin):
    x, recording = twin
    found, deviations, total = smoothing.smoothed(CART_POLE, recording)
    e = (found - x)[25:-12]
    assert (np.sqrt((e[:, 2:] ** 2).mean(0)) < 1.5 * deviations[25:-12, 2:].mean(0)).all()
    assert np.abs((found - x)[98:106, 3]).max() < 0.15
    trusting, _, worse = smoothing.smoothed(CART_POLE, recording, skip=False)
    assert np.abs((trusting - x)[98:106, 3]).max() > 0.5
    assert worse > total
    wrong = [2.0 * CART_POLE.model.params[0], *CART_POLE.model.params[1:]]
    assert smoothing.smoothed(CART_POLE, recording, wrong)[2] > total


def test_scores_by_their_definitions(twin):
    x, recording = twin
    late = [np.vstack([x[:1, 2:], x[:-1, 2:]])]
    score = scoring.score(CART_POLE, [recording] * 3, late * 3, [x[:, 2:]] * 3, 1)
    assert score.lag == pytest.approx(PERIOD, rel=0.05)
    mask = scoring.scored(CART_POLE, recording)
    assert not mask[:25].any()
    assert not mask[97:118].any()
    assert mask[118]
    e = (late[0] - x[:, 2:])[mask, 1]
    assert score.rmse == pytest.approx(np.sqrt((e**2).mean()))
    assert score.ci_low == pytest.approx(score.ci_high)  # three equal runs
    assert score.fault_median == pytest.approx(np.abs((late[0] - x[:, 2:])[98:106, 1]).max())
    half = [x[:, 2:] + 0.5 * (late[0] - x[:, 2:])]
    nearer = scoring.score(CART_POLE, [recording] * 3, half * 3, [x[:, 2:]] * 3, 1)
    beside = scoring.difference(CART_POLE, [recording] * 3, nearer, score)
    assert (beside.value, beside.ci_low, beside.ci_high) == pytest.approx([-0.5 * score.rmse] * 3)
    assert (beside.better, beside.runs) == (3, 3)
    lost = scoring.score(CART_POLE, [recording], [x[:, 2:] + 1.0], [x[:, 2:]], 1)
    assert lost.lost == 1


@pytest.fixture(scope="module")
def runs():
    return on_recordings.Runs.of(CART_POLE, load(CART_POLE, DATA, "test"))


@there
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cart", "pole", "fault"),
    [
        ("kalman-ca", 0.0096, 0.164, 12.0),
        ("steady-kalman", 0.0047, 0.061, 4.0),
        ("ekf", 0.0050, 0.045, 3.0),
        ("ekf-adaptive", 0.0050, 0.045, 0.3),
        ("super-twisting", 0.0063, 0.085, 0.35),
        ("smo", 0.018, 0.070, 0.35),
    ],
)
def test_tuned_observers_on_the_test_runs(runs, name, cart, pole, fault):
    rows = on_recordings.rows(runs, {name: candidates.named("cartpole")[name]})
    first, second = [row for row in rows if row.reference == smoothing.MODEL]
    assert first.rmse <= cart
    assert second.rmse <= pole
    assert second.fault_median <= fault
    assert second.lost == 0


@there
@pytest.mark.slow
def test_backward_differences_check_loader_scale_and_mask(runs):
    name = "backward-difference"
    rows = on_recordings.rows(runs, {name: candidates.named("cartpole")[name]})
    first, second = [row for row in rows if row.reference == smoothing.MODEL]
    assert first.rmse == pytest.approx(0.0359, rel=0.02)
    assert second.rmse == pytest.approx(0.243, rel=0.02)
    assert (first.runs, len(second.each)) == (30, 30)


@there
@pytest.mark.slow
def test_runs_are_lost_where_the_conditions_fail(runs):
    smo = candidates.named("cartpole")["smo"].build(CART_POLE.model)
    assert isinstance(smo, SlidingModeObserver)
    rows = {(row.gain, row.value, row.start): row for row in real_sweeps.lost(runs, smo)}
    assert all(rows["m1", m1, "cold"].lost == 30 for m1 in (1.0, 2.0, 4.0))
    assert all(rows["m1", m1, "cold"].lost == 0 for m1 in (13.0, 16.0, 20.0))
    assert rows["m1", 4.0, "cold"].holds == 0
    assert rows["m1", 13.0, "cold"].holds == 30
    assert all(rows["beta_1", beta, "cold"].lost == 0 for beta in (6.0, 8.0, 12.0))
    assert rows["beta_1", 0.0, "cold"].lost >= 20


@there
@pytest.mark.slow
def test_the_command_writes_the_table(command, tmp_path):
    given = ("--data", DATA, "--observer", "ekf", "backward-difference", "--out", tmp_path)
    command("observers", *given, "--figure", "--report")
    header = (tmp_path / "real.csv").read_text().splitlines()[0]
    wanted = (
        "rig,observer,channel,reference,rmse,ci_low,ci_high,lag_ms,total_variation,largest,fault_median,fault_largest"
    )
    assert header == f"{wanted},lost,runs,ns"
    assert (tmp_path / "fault.png").exists()
    page = (tmp_path / "observers.html").read_text(encoding="utf-8")
    assert page.count('<th scope="row">ekf</th>') == 2  # rigs
    assert "<svg" in page
