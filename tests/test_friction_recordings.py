"""A real cart pole beside the plant with friction: skipped where its recordings are not."""

import runpy

import numpy as np
import pytest
from conftest import ROOT

FOLDER = ROOT.parent / "shared" / "data" / "cartpole" / "test"


@pytest.mark.skipif(not FOLDER.is_dir(), reason="wants the recordings of a real cart pole beside the repository")
def test_half_a_second_of_a_real_swing_up_is_overlaid():
    rig = runpy.run_path(str(ROOT / "benchmarks" / "cart_pole.py"))
    positions, commands = rig["windows"](sorted(FOLDER.glob("*.csv"))[:8])
    rms = np.sqrt(((rig["overlaid"](positions, commands) - positions) ** 2).mean(axis=2))
    assert len(rms) >= 30
    assert (np.median(rms, axis=0) < [0.0015, 0.006]).all()
    assert (rms < [0.015, 0.03]).all()
    assert np.ptp(positions[:, 0], axis=1).max() > 0.1  # the cart goes far, against 1.5 mm
