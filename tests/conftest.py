"""Shared helpers."""

import gymnasium
import numpy as np
import pytest

import smo_gym  # noqa: F401  registers the environments
from smo_gym.evaluation.arms import ARMS

IDS = ("SMOPendulum-v0", "SMOPendulumUpright-v0", "SMOPendulumTracking-v0")


@pytest.fixture(params=IDS)
def env_id(request):
    return request.param


@pytest.fixture
def registry():
    """The arms, left as they were."""
    known = dict(ARMS)
    yield ARMS
    ARMS.clear()
    ARMS.update(known)


@pytest.fixture
def make_vec():
    """A native vector environment."""

    def make(n, id="SMOPendulum-v0", **options):
        return gymnasium.make_vec(id, n, vectorization_mode="vector_entry_point", **options)

    return make


def assert_same(a, b, path="info"):
    """Equal to the bit, through nested dictionaries."""
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            assert_same(a[key], b[key], f"{path}[{key!r}]")
    elif isinstance(a, np.ndarray) and a.dtype == object:
        for x, y in zip(a, b, strict=True):
            assert (x is None) == (y is None), path
            assert x is None or np.array_equal(x, y), path
    else:
        assert np.array_equal(a, b), path
