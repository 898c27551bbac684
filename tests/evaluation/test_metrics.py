"""Meters of one's own: which names they may have."""

import numpy as np
import pytest

from smo_gym.evaluation import metrics
from smo_gym.evaluation.metrics import Meter, Metric


def meter(name, metric="extra"):
    return Meter(name, (Metric(metric, "1", "nothing"),), 1, lambda rows, period: np.zeros((1, rows.shape[1])))


@pytest.mark.parametrize("name", ["end", "guard", "plant", "forces"])
def test_a_meter_takes_the_place_of_no_part_of_the_loop(name):
    with pytest.raises(ValueError, match=f"cannot be named '{name}': a part of every loop is"):
        metrics.register(meter(name))
    assert name not in metrics.METERS


def test_a_name_is_given_once():
    metrics.register(meter("mine"))
    assert metrics.names()[-1] == "extra"
    with pytest.raises(ValueError, match="'mine' is registered already"):
        metrics.register(meter("mine", "other"))
    with pytest.raises(ValueError, match="metrics mse_h are measured already"):
        metrics.register(meter("yours", "mse_h"))
