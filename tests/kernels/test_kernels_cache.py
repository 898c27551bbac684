"""Kernels in processes of their own: stale, damaged and missing caches, no compiler, a processor without FMA."""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

import smo_gym

pytestmark = pytest.mark.slow
_PROBE = """
import numpy as np
from smo_gym.plant import CartPendulum, advance
x = np.array([[0.0], [1.0], [0.0], [0.0]])
advance(x, CartPendulum().as_array()[:, None], np.zeros(1), 0.001, np.empty((10, 2, 1)))
print(repr(float(x[3, 0])))
"""
_LIGHT = """
from smo_gym.plant import CartPendulum
print(CartPendulum().drift([0.0, 1.0, 0.0, 0.0]).tolist())
"""


def _probe(cwd, probe=_PROBE, **environment):
    """A probe in a process of its own, whatever this one's surroundings say of Numba."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    command = [sys.executable, "-c", probe]
    return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True, env=kept | environment)


def _package(folder):
    """A copy of the package, without what was compiled."""
    shutil.copytree(Path(smo_gym.__file__).parent, folder / "smo_gym", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A package, its cache in a folder beside it, and what a probe that filled the cache printed."""
    folder = _package(tmp_path_factory.mktemp("whole"))
    done = _probe(folder, NUMBA_CACHE_DIR=str(folder / "cache"))
    assert done.stderr == ""
    return folder, folder / "cache", done.stdout


@pytest.fixture(scope="module")
def light(tmp_path_factory):
    """The same of a probe that needs a single small kernel."""
    folder = _package(tmp_path_factory.mktemp("light"))
    done = _probe(folder, _LIGHT, NUMBA_CACHE_DIR=str(folder / "cache"))
    assert done.stderr == ""
    return folder, folder / "cache", done.stdout


def test_a_change_of_the_equations_is_never_hidden_by_the_cache(tmp_path):
    _package(tmp_path)

    def run():
        return _probe(tmp_path).stdout

    before = run()
    assert list((tmp_path / "smo_gym" / "__pycache__").glob("plant._step*.nbc"))
    assert run() == before
    equations = tmp_path / "smo_gym" / "kernels" / "cart_pendulum.py"
    changed = equations.read_text().replace("(M_c + m) * g * sin", "(M_c + 2 * m) * g * sin")
    assert changed != equations.read_text()
    equations.write_text(changed)
    assert run() != before


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"\0" * 99])
@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_cache_is_said_once_and_mended(light, tmp_path, damage, kind):
    folder, cache, printed = light
    place = {"NUMBA_CACHE_DIR": str(shutil.copytree(cache, tmp_path / "cache"))}
    files = list(tmp_path.rglob(f"*.{kind}"))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    damaged = _probe(folder, _LIGHT, **place)
    assert damaged.stdout == printed
    assert damaged.stderr.count("compiled kernels cannot be cached or read back") == 1
    again = _probe(folder, _LIGHT, **place)
    assert (again.stdout, again.stderr) == (printed, "")


def test_a_cache_that_cannot_be_written_is_no_failure(light, tmp_path):
    folder, _, printed = light
    (tmp_path / "file").write_text("")
    done = _probe(folder, _LIGHT, NUMBA_CACHE_DIR=str(tmp_path / "file" / "cache"))
    assert done.stdout == printed
    assert done.stderr.count("compiled kernels cannot be cached") <= 1  # none where Numba finds another folder


def test_without_a_compiler_the_bits_are_the_same(whole, tmp_path):
    assert _probe(tmp_path, NUMBA_DISABLE_JIT="1", PYTHONPATH=str(ROOT)).stdout == whole[2]


def test_a_processor_without_fma_is_named(whole, tmp_path):
    place = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = _probe(tmp_path, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", **place)
    assert done.stdout == whole[2]
    if platform.machine().lower() in ("x86_64", "amd64"):
        assert done.stderr.count("no fused multiply-add") == 1
