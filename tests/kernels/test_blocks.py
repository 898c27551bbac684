"""Blocks: every one of the package is vector code, and what is no block is said."""

import importlib
import inspect
import os
import pkgutil
import platform
import re
import subprocess
import sys

import numba
import numpy as np
import pytest
from conftest import ROOT
from numba.core.errors import NumbaError

import smo_gym
from smo_gym import CartPendulum
from smo_gym.kernels.blocks import SIGNATURE, U, address, at, block, put
from smo_gym.loop import Loop, Part, columns
from smo_gym.observers import OBSERVERS

ARGUMENTS = ["signals", "own", "lanes"]
STORES = re.compile(r"^\s+v?mov[au]p[ds]\s+%[xyz]mm\d+,\s*.*\(", re.MULTILINE)
CALLS = re.compile(r"^\s+call\w*\s+(.*)$", re.MULTILINE)


def blocks():
    """All of the package by name: what is compiled and has the arguments of a block."""
    for found in pkgutil.walk_packages(smo_gym.__path__, "smo_gym."):
        if found.name.endswith("__main__"):
            continue
        for name, value in vars(importlib.import_module(found.name)).items():
            function = getattr(value, "py_func", None)
            if (
                getattr(function, "__module__", None) == found.name
                and [*inspect.signature(function).parameters] == ARGUMENTS
            ):
                yield f"{found.name}.{name}", function


BLOCKS = dict(blocks())


def assembly(function):
    """Of a block alone, compiled anew: what comes from the cache has none to show."""
    fresh = numba.njit(error_model="numpy", nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)
    fresh.compile(SIGNATURE.args)
    return fresh.inspect_asm(SIGNATURE.args)


def test_all_kinds_of_parts_are_found():
    rooms = {name.split(".")[1] for name in BLOCKS}
    assert {"actuators", "controllers", "envs", "evaluation", "observers", "plant", "sensors"} <= rooms


x86 = pytest.mark.skipif(
    platform.machine().lower() not in ("x86_64", "amd64") or bool(numba.config.BOUNDSCHECK),
    reason="reads x86 assembly, which checks of indices are no part of",
)


@x86
@pytest.mark.parametrize("name", BLOCKS)
def test_every_block_is_vector_code_and_calls_nothing(name):
    code = assembly(BLOCKS[name])
    assert STORES.search(code), "no lane beside another: see the module's docstring and look for branches"
    assert not CALLS.findall(code)


@x86
@pytest.mark.parametrize("name", [name for name in OBSERVERS if name != "mhe"])
def test_an_observers_block_is_vector_code_around_a_model_too(name):
    code = assembly(OBSERVERS[name]().part(1, 0.001, 30.0, CartPendulum()).sample.py_func)
    assert STORES.search(code)
    assert "divpd" in code or "divsd" not in code, "is an offset known too late?"
    assert not CALLS.findall(code)


@x86
def test_a_block_that_is_not_would_be_seen():
    def called(signals, own, lanes):
        for i in range(lanes):
            put(signals, U, i, np.sin(at(signals, U, i)))

    def branched(signals, own, lanes):
        for i in range(lanes):
            u = at(signals, U, i)
            while u > 1.0:
                u *= 0.5
            put(signals, U, i, u)

    assert CALLS.search(assembly(called))
    assert not STORES.search(assembly(branched))


def test_what_is_no_block_is_said():
    @block
    def two_arguments(signals, own):
        signals[0] = own[0]

    @block
    def answers(signals, own, lanes):
        return signals[0]

    @block
    def other_types(signals, own, lanes):
        for i in range(lanes):
            signals[i] = own.x_hat[i]

    def plain(signals, own, lanes):
        signals[0] = 0.0

    with pytest.raises(TypeError, match="3 argument types given, but function takes 2 arguments"):
        address(two_arguments)
    with pytest.raises(NumbaError, match="x_hat"):
        address(other_types)
    with pytest.raises(TypeError, match=r"answers.* must return nothing: a block writes into rows"):
        address(answers)
    with pytest.raises(TypeError, match=r"plain.* must be compiled: mark it with @smo_gym\.kernels\.blocks\.block"):
        address(plain)


@block
def _refuses(signals, own, lanes):
    for i in range(lanes):
        if at(own, 0, i) > 2.0:
            raise ValueError("more than two")


@pytest.mark.parametrize("when", ["act", "sample", "close"])
def test_what_a_block_raises_reaches_python(when):
    rows = np.arange(5.0)[None]
    loop = Loop(5, 2, {"law": Part(rows, **{when: _refuses})})
    with pytest.raises(ValueError, match="more than two"):
        loop.run()
    fine = Loop(2, 2, {"law": Part(rows[:, :2], **{when: _refuses})})
    fine.run()


def test_what_a_block_raises_in_a_thread_reaches_python(monkeypatch):
    monkeypatch.setattr("smo_gym.kernels.batch._WORTH_A_THREAD", 0.0)
    monkeypatch.setattr("smo_gym.kernels.batch._pool.threads", 2)
    rows = columns(300, 0.0)
    rows[0, -1] = 3.0
    with pytest.raises(ValueError, match="more than two"):
        Loop(300, 1, {"law": Part(rows, act=_refuses)}).run()


FAULTY = """
from smo_gym.kernels.blocks import block, put
from smo_gym.loop import Loop, Part, columns
from smo_gym.observers import OBSERVERS

@block
def beyond(signals, own, lanes):
    for i in range(lanes):
        put(own, 1, i, 1.0)

for rows in (2, 1):
    Loop(3, 1, {"law": Part(columns(3, *[0.0] * rows), act=beyond), "observer": Part(columns(3, 0.0))}).run()
    print("ran with", rows)
"""


@pytest.mark.slow
def test_a_row_beyond_a_parts_own_is_an_error_where_bounds_are_checked(tmp_path):
    (tmp_path / "faulty.py").write_text(FAULTY, encoding="utf-8")
    place = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "faulty.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=os.environ | place)
    assert done.stdout == "ran with 2\n"
    assert "IndexError: index is out of bounds" in done.stderr
