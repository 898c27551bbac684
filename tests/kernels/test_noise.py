"""Random numbers of a key and an index: what they are, that they are independent, the same wherever they are made."""

import math
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from conftest import ROOT
from scipy import stats

from smo_gym.kernels.elementary import log
from smo_gym.kernels.interpreted import GOLDEN, mixed
from smo_gym.kernels.interpreted import uniform as by_definition
from smo_gym.kernels.noise import STREAMS, two_normals, uniform

N = 1_000_000
SIGMAS = 5.0


@numba.njit
def _uniforms(keys, indices):
    out = np.empty(keys.size)
    for i in range(keys.size):
        out[i] = uniform(keys[i], indices[i])
    return out


@numba.njit
def _normals(keys, indices):
    out = np.empty((2, keys.size))
    for i in range(keys.size):
        out[0, i], out[1, i] = two_normals(uniform(keys[i], indices[i]), uniform(keys[i], indices[i] + 1.0))
    return out


@numba.njit
def _logs(x):
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = log(x[i])
    return out


def draws(keys, samples, stream=0):
    """Uniforms of some keys, (keys, samples)."""
    k, n = np.meshgrid(np.asarray(keys, float), np.arange(samples, dtype=float) * STREAMS + stream, indexing="ij")
    return _uniforms(k.ravel(), n.ravel()).reshape(k.shape)


def normals(keys, samples):
    """Two normals of some keys, (2, keys, samples)."""
    k, n = np.meshgrid(np.asarray(keys, float), np.arange(samples, dtype=float) * STREAMS, indexing="ij")
    return _normals(k.ravel(), n.ravel()).reshape(2, *k.shape)


def correlated(a, b):
    """Correlation of two samples in standard deviations of that of independent ones."""
    return abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) * math.sqrt(a.size)


def test_a_number_is_what_the_definition_says():
    rng = np.random.default_rng(0)
    keys = np.concatenate([[0.0, 1.0, 2.0**52 - 1], rng.integers(0, 2**52, 300).astype(float)])
    indices = np.concatenate([[0.0, 2.0**52 - 1, 1.0], rng.integers(0, 2**52, 300).astype(float)])
    found = _uniforms(keys, indices)
    assert found.tolist() == [by_definition(k, n) for k, n in zip(keys, indices, strict=True)]
    assert (found >= 0.0).all()
    assert (found < 1.0).all()
    assert (found * 2.0**52 % 1.0 == 0.0).all()


def test_the_mixer_gives_the_published_numbers_of_splitmix64():
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423]  # of the seed 1234567
    assert [mixed((1234567 + i * GOLDEN) % 2**64) for i in (1, 2, 3)] == published


def test_neighbouring_keys_have_no_number_in_common():
    d = np.arange(1, 2**20 + 1, dtype=np.uint64)
    ahead = d * np.uint64(GOLDEN)
    assert np.minimum(ahead, -ahead).min() > 2**40


@pytest.mark.parametrize("stream", [0, 31])
def test_uniforms_are_uniform(stream):
    u = draws(range(1000), N // 1000, stream)
    assert stats.kstest(u.ravel(), "uniform").pvalue > 1e-5
    pairs, _, _ = np.histogram2d(u[:, ::2].ravel(), u[:, 1::2].ravel(), bins=64, range=[[0, 1], [0, 1]])
    assert stats.chisquare(pairs.ravel()).pvalue > 1e-5
    low = u * 2.0**20 % 1.0  # the bits below the twentieth
    assert stats.kstest(low.ravel(), "uniform").pvalue > 1e-5


@pytest.mark.parametrize("keys", [range(1000), np.arange(1000) * 2**42, 2**52 - 1 - np.arange(1000)])
def test_normals_are_normal_and_independent(keys):
    z = normals(keys, N // 1000)
    for each in z:
        assert abs(each.mean()) < SIGMAS / math.sqrt(N)
        assert abs(each.var() - 1.0) < SIGMAS * math.sqrt(2.0 / N)
        assert stats.kstest(each.ravel(), "norm").pvalue > 1e-5
    assert correlated(z[0], z[1]) < SIGMAS
    for each in (*z, *z**2):
        for lag in (1, 2, 3, 7, 64):
            assert correlated(each[:, lag:], each[:, :-lag]) < SIGMAS
            assert correlated(each[lag:], each[:-lag]) < SIGMAS  # of another key, the same sample


def test_the_largest_normal_is_finite():
    @numba.njit
    def ends():
        return two_normals(1.0 - 2.0**-52, 0.0), two_normals(0.0, 0.5)

    (largest, zero), least = ends()
    assert largest == pytest.approx(math.sqrt(104.0 * math.log(2.0)), rel=1e-15)
    assert zero == 0.0
    assert least == (0.0, 0.0)


def test_log_is_accurate_to_the_last_bit():
    near_one = 1.0 + np.linspace(-1e-3, 1e-3, 100_001)
    x = np.concatenate([np.random.default_rng(0).uniform(0, 2, N), np.geomspace(2.3e-308, 1.7e308, N), near_one])
    exact = np.log(x)
    assert (np.abs(_logs(x) - exact) <= 2.0 * np.spacing(np.abs(exact))).all()
    assert _logs(np.array([1.0, 2.0**-52])).tolist() == [0.0, -52.0 * math.log(2.0)]


PROBE = """
import sys
sys.path.insert(0, "tests/kernels")
from test_noise import some
print(some().hex())
"""


def some():
    """Normals of a few keys and indices, as bytes."""
    rng = np.random.default_rng(1)
    return _normals(rng.integers(0, 2**52, 500).astype(float), rng.integers(0, 2**40, 500).astype(float)).tobytes()


def test_without_a_compiler_the_bits_are_the_same():
    path = os.pathsep.join(map(str, (ROOT, ROOT / "tests")))
    place = os.environ | {"PYTHONPATH": path, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, env=place)
    assert done.stdout.strip() == some().hex()
