"""Numbers that are known, those of twins, are found again; what cannot be found is said."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT

from smo_gym.recordings import CART_POLE, Recording, fitting, load, scoring, searching, smoothing, twins

DATA = ROOT.parent / "shared" / "data"
there = pytest.mark.skipif(not DATA.is_dir(), reason="wants the recordings of real machines beside the repository")
HELD = CART_POLE.held


def excited(run):
    """An input that swings the pole, and where it begins."""
    n = 230
    t = CART_POLE.period * np.arange(n)
    u = 0.8 * np.sign(np.sin((3.0 + run) * t + run))
    y = np.full((n, 2), [0.0, np.pi])
    return Recording(f"run {run}", t, y, u, np.zeros(n, dtype=bool))


@pytest.fixture(scope="module")
def runs():
    return [twins.twin(CART_POLE, excited(run), run) for run in range(4)]


def test_a_twin_has_the_noise_of_its_rig(runs):
    recordings, truths = zip(*runs, strict=True)
    for recording in recordings:
        counts = recording.y / CART_POLE.quanta
        assert counts == pytest.approx(np.round(counts), abs=1e-6)
    e = np.concatenate([recording.y - x[:, :2] for recording, x in runs])
    assert e.std(0) == pytest.approx(CART_POLE.noise, rel=0.05)
    found, sd, _ = zip(*(smoothing.smoothed(CART_POLE, each) for each in recordings), strict=True)
    error = np.concatenate([(a - b)[25:-12, 2:] for a, b in zip(found, truths, strict=True)])
    said = np.concatenate([each[25:-12, 2:] for each in sd])
    assert np.sqrt((error**2).mean(0)) == pytest.approx(np.sqrt((said**2).mean(0)), rel=0.15)


def test_a_twin_is_its_seed_and_input(runs):
    again, other = twins.twin(CART_POLE, excited(0), 0), twins.twin(CART_POLE, excited(0), 1)
    np.testing.assert_array_equal(again[0].y, runs[0][0].y)
    assert np.abs(other[1] - again[1]).max() > 0.1


def test_the_numbers_of_twins_are_found_within_their_errors(runs):
    off = replace(CART_POLE.of(1.1 * np.array(CART_POLE.model.params)), acceleration=(0.2, 0.2))
    found = fitting.fit(off, [recording for recording, _ in runs], HELD)
    assert found.names[-3:] == ("noise theta", "acceleration h", "acceleration theta")
    away = (found.values[:9] - CART_POLE.model.params) / found.errors[:9]
    assert (np.abs(away) < 4.0).all()
    assert np.sqrt((away**2).mean()) < 1.8
    noise = [CART_POLE.noise[1], *CART_POLE.acceleration]
    assert found.values[9:] == pytest.approx(noise, rel=0.2)  # steps of an encoder are no white noise
    assert found.errors[0] < 0.01 * CART_POLE.model.params[0]
    assert found.left < searching.ENOUGH
    assert found.loss <= fitting.loss(CART_POLE, [recording for recording, _ in runs])
    assert found.rig.noise[0] == CART_POLE.noise[0]


def test_what_recordings_do_not_tell_is_said(runs):
    unbiased = CART_POLE.of([*CART_POLE.model.params[:8], 0.0])
    still, _ = twins.twin(unbiased, replace(runs[0][0], u=np.zeros(230)), 0)  # nothing shows what the motor's gain is
    with pytest.raises(
        fitting.NotConverged, match=r"the log-likelihood is flat, most of all along 'c': hold .*\(noise h, u0, c\)"
    ):
        fitting.fit(unbiased, [still], (*HELD, "u0"), rounds=1)
    fitting.fit(unbiased, [still], (*HELD, "u0", "c"))


def test_a_number_that_is_held_is_known(runs):
    with pytest.raises(ValueError, match="unknown number 'noise x'"):
        fitting.fit(CART_POLE, [runs[0][0]], ("noise x",))


@there
@pytest.mark.slow
def test_the_reference_is_as_near_to_the_truth_of_twins_as_it_says():
    rig = CART_POLE
    pairs = [twins.twin(rig, recording, seed) for seed, recording in enumerate(load(rig, DATA, "test"))]
    recordings, truths = [recording for recording, _ in pairs], [x[:, 2:] for _, x in pairs]
    by = smoothing.references(rig, recordings)
    errors = {name: [scoring.score(rig, recordings, by[name], truths, c).rmse for c in (0, 1)] for name in by}
    assert errors[smoothing.MODEL] == pytest.approx([0.0047, 0.027], rel=0.05)
    assert errors[smoothing.JERK] == pytest.approx([0.0093, 0.059], rel=0.05)
    assert errors[smoothing.POLYNOMIAL] == pytest.approx([0.0131, 0.056], rel=0.05)


@there
@pytest.mark.slow
def test_the_rigs_numbers_are_those_of_the_training_runs():
    found = fitting.fit(CART_POLE, load(CART_POLE, DATA, "train"), HELD)
    truth = [*CART_POLE.model.params, CART_POLE.noise[1], *CART_POLE.acceleration]
    assert (np.abs(found.values - truth) < 5.0 * found.errors).all()
    assert found.loss == pytest.approx(-6.840, abs=0.001)
    assert fitting.loss(found.rig, load(CART_POLE, DATA, "test")) == pytest.approx(-6.795, abs=0.001)
