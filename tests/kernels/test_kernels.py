"""The compiled ground floor: accuracy, and results that do not depend on the batch."""

import itertools
import math

import numba
import numpy as np
import pytest

import smo_gym
from smo_gym.kernels import elementary, interpreted
from smo_gym.kernels.batch import LANES
from smo_gym.kernels.elementary import sincos, tanh
from smo_gym.observers import SlidingModeObserver
from smo_gym.plant import CartPendulum, advance


@numba.njit
def _evaluate(x):
    out = np.empty((3, x.size))
    for i in range(x.size):
        out[0, i], out[1, i] = sincos(x[i])
        out[2, i] = tanh(x[i])
    return out


def test_sin_and_cos_are_accurate_to_the_last_bit_or_two():
    x = np.concatenate([np.linspace(-30, 30, 100_001), np.random.default_rng(0).uniform(-1e5, 1e5, 100_000)])
    sin, cos, _ = _evaluate(x)
    assert np.abs(sin - np.sin(x)).max() < 3e-16
    assert np.abs(cos - np.cos(x)).max() < 3e-16


def test_sin_keeps_its_relative_accuracy_near_zero():
    x = np.geomspace(1e-300, 0.5, 10_000)
    assert np.abs(_evaluate(x)[0] / np.sin(x) - 1).max() < 5e-16


def test_tanh_is_accurate_for_tiny_and_huge_arguments():
    x = np.concatenate([np.geomspace(1e-300, 25, 100_000), -np.geomspace(1e-300, 25, 1000)])
    assert np.abs(_evaluate(x)[2] / np.tanh(x) - 1).max() < 1.2e-15
    assert _evaluate(np.array([1e300, -math.inf, math.inf, 0.0]))[2].tolist() == [1.0, -1.0, 1.0, 0.0]


def test_nan_comes_out_as_nan():
    assert np.isnan(_evaluate(np.array([math.nan]))).all()


def _batch(n, steps=5):
    """Plants and observers of a batch after a few steps, all inputs depending on the slot alone."""
    draws = [np.random.default_rng(slot) for slot in range(n)]
    x = np.array([rng.uniform(-1.0, 1.0, 4) for rng in draws]).T.copy()
    params = np.array([CartPendulum().draw(0.2, rng).as_array() for rng in draws]).T.copy()
    u = np.array([rng.uniform(-30.0, 30.0) for rng in draws])
    estimator = SlidingModeObserver().start(n, 0.001, 30.0, CartPendulum())
    samples = np.empty((steps, 2, n))
    estimator.reset(np.ones(n, dtype=np.bool_), x[:2])
    advance(x, params, u, 0.001, samples)
    estimator.update(samples, u)
    return x, estimator.xhat


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 15, 16, 31, 33, LANES, LANES + 1, 3 * LANES + 5])
def test_a_slot_gives_the_same_bits_in_every_batch(n):
    x, xhat = _batch(n)
    x_all, xhat_all = _batch(4 * LANES)
    assert (x == x_all[:, :n]).all()
    assert (xhat == xhat_all[:, :n]).all()


def test_threads_do_not_change_a_bit(monkeypatch):
    monkeypatch.setattr("smo_gym.kernels.batch._WORTH_A_THREAD", 0.0)
    results = []
    for threads in (1, 2, 3):
        smo_gym.set_threads(threads)
        results.append(_batch(5 * LANES + 3))
    smo_gym.set_threads(2)
    for x, xhat in results[1:]:
        assert (x == results[0][0]).all()
        assert (xhat == results[0][1]).all()


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2"])
def test_threads_must_be_a_positive_integer(threads):
    with pytest.raises(ValueError, match="threads=.* must be a positive integer"):
        smo_gym.set_threads(threads)


@numba.njit
def _fma(a, b, c):
    return elementary.fma(a, b, c)


def test_the_interpreted_fma_is_the_processors():
    rng = np.random.default_rng(0)
    numbers = rng.choice([-1.0, 1.0], (3000, 3)) * 10.0 ** rng.uniform(-320.0, 308.0, (3000, 3))
    special = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, 1.7e308]
    with np.errstate(all="ignore"):
        numbers[1000:, 2] = (
            -numbers[1000:, 0] * numbers[1000:, 1] * rng.choice([1.0, 1.0 + 2e-16], 2000)
        )  # cancellation
        cases = [*numbers.tolist(), *itertools.product(special, repeat=3)]
        for a, b, c in cases:
            here, there = interpreted.fma(a, b, c), _fma(a, b, c)
            assert here == there or (np.isnan(here) and np.isnan(there)), (a, b, c)
            assert np.signbit(here) == np.signbit(there) or np.isnan(here), (a, b, c)
