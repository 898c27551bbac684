"""The search for the least loss, on losses whose least is known."""

import numpy as np
import pytest

from smo_gym.recordings import searching
from smo_gym.recordings.searching import ENOUGH, search

LENGTH = 1e6
"""By how much the ridge is longer than wide."""


def ridge(x):
    """A normal density of standard errors 3 and 4e-3, correlated but for 1e-6, and a third number of its own."""
    a, b = (x[0] - 5.0) / 3.0, (x[1] - 2e-3) / 4e-3
    return 1e3 + 0.5 * ((a + b) ** 2 / 4.0 + LENGTH * (a - b) ** 2 / 4.0 + ((x[2] + 7.0) / 0.1) ** 2)


def test_a_ridge_is_followed_to_its_end():
    found = search(ridge, np.array([-40.0, 0.0, 1.0]), 5)
    assert found.converged
    assert found.left < ENOUGH
    error = np.sqrt(1.0 + 1.0 / LENGTH)
    assert found.errors == pytest.approx([3.0 * error, 4e-3 * error, 0.1], rel=1e-3)
    assert np.abs((found.x - [5.0, 2e-3, -7.0]) / found.errors).max() < 0.25


def test_what_does_not_matter_is_flat():
    found = search(lambda x: ridge(np.array([x[0] + x[1], 2e-3, x[2]])), np.array([3.0, 1.0, -7.0]), 2)
    assert found.flat
    assert not found.converged
    assert found.loosest in (0, 1)


def test_a_search_that_was_cut_off_says_what_is_left(monkeypatch):
    def valley(x):  # Rosenbrock's
        return 2e4 * (x[1] - x[0] ** 2) ** 2 + 100.0 * (1.0 - x[0]) ** 2

    start = np.array([-1.0, 1.5])
    whole = search(valley, start, 5)
    assert whole.converged
    assert np.abs((whole.x - 1.0) / whole.errors).max() < 0.25
    monkeypatch.setattr(searching, "ITERATIONS", 2)
    part = search(valley, start, 1)
    assert not part.converged
    assert part.left > ENOUGH
