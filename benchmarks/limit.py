"""How near the loop comes to C that is written for one closed loop alone: nanoseconds of a step of a slot, one core.

    python benchmarks/limit.py

Both are run by turns and must give the same mean squares. The C has no settings, parts, metrics or failures.
"""

import ctypes
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop import DT, begin, closed_loop, least, run
from tabulate import tabulate

import smo_gym
from smo_gym import CartPendulum
from smo_gym.evaluation.metrics import EFFORT, SAMPLES, SQUARES, add
from smo_gym.evaluation.scenario import named
from smo_gym.kernels.batch import LANES
from smo_gym.kernels.blocks import U, X, at, block
from smo_gym.loop import Loop, Part, columns
from smo_gym.typing import Array

N, STEPS, REPEATS = 512, 400, 40
SOURCE = Path(__file__).with_name("limit.c")
FLAGS = ["-O3", "-march=native", "-ffast-math", "-fno-associative-math", "-fopenmp-simd", "-fPIC", "-shared"]
if platform.machine().lower() in ("x86_64", "amd64"):
    FLAGS += ["-mprefer-vector-width=512"]
ROWS, STATE, SUMS = 15, slice(3, 7), slice(12, 15)
"""Rows of a block in C, and where the state and the sums of squares stand."""


@block
def _sample(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        h, theta = at(signals, X, i), at(signals, X + 1, i)
        add(own, 0, i, h * h, True)
        add(own, 1, i, theta * theta, True)


@block
def _close(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        add(own, 2, i, at(signals, U, i) * at(signals, U, i), True)


def same_parts(loop: Loop) -> Loop:
    """Of a loop what the C has, with its three sums alone."""
    parts: dict[str, Any] = {role: loop.parts[role] for role in ("law", "plant", "sensor", "observer")}
    sums = Part(columns(loop.n, np.zeros(3)), sample=_sample, close=_close)
    return Loop(loop.n, loop.substeps, {**parts, "metrics": sums})


class InC:
    """The same plants from the same states as a loop's, in C."""

    def __init__(self, library: ctypes.CDLL, loop: Loop) -> None:
        settings = named("regulation").controllers["lqr"]
        gains = settings.observer.build(True).gains
        numbers: Any = [*CartPendulum().as_array(), *settings.K.value, *gains.m1, *gains.beta_1, *gains.beta_2]
        self.settings = np.array([*numbers, *settings.observer.slopes.value])
        begin(loop)
        self.first = np.zeros((N // LANES, ROWS, LANES))
        for target, rows in ((slice(0, 3), loop.own("plant")[:3]), (STATE, loop.x)):
            self.first[:, target] = rows.reshape(len(rows), -1, LANES).transpose(1, 0, 2)
        self.blocks = self.first.copy()
        self.drive, self.substeps = library.drive, loop.substeps
        pointer, whole = ctypes.c_void_p, ctypes.c_int
        self.drive.argtypes = [pointer, whole, pointer, whole, whole, ctypes.c_double]

    def work(self) -> float:
        """As :func:`closed_loop.run`'s."""
        self.blocks[:] = self.first
        began = time.thread_time()
        blocks, settings = self.blocks.ctypes.data, self.settings.ctypes.data
        self.drive(blocks, len(self.blocks), settings, STEPS // self.substeps, self.substeps, DT)
        return (time.thread_time() - began) * 1e9 / (STEPS * N)

    def sums(self) -> Array:
        """Of squares of h, theta and the force, (3, n)."""
        return self.blocks[:, SUMS].transpose(1, 0, 2).reshape(3, -1)


def compiled(folder: Path) -> ctypes.CDLL:
    """The C, compiled; the process ends where no compiler is."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        sys.exit("no C compiler here (cc, gcc or clang): there is nothing to compare with")
    library = folder / "limit.so"
    subprocess.run([compiler, *FLAGS, str(SOURCE), "-o", str(library)], check=True)
    version = subprocess.run([compiler, "--version"], check=True, capture_output=True, text=True).stdout
    print(f"{version.splitlines()[0]}, {' '.join(FLAGS)}\n")
    return ctypes.CDLL(str(library))


def main() -> None:
    smo_gym.set_threads(1)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(Path(folder))
        for control_period in (0.001, 0.02):
            loop = closed_loop("lqr", N, control_period)
            same, in_c = same_parts(loop), InC(library, loop)
            works = {"C": in_c.work, "the same parts": run(same, STEPS), "everything": run(loop, STEPS)}
            times = least(works, REPEATS)
            rows += [(f"{1e3 * control_period:g}", name, t, f"{times['C'] / t:.0%}") for name, t in times.items()]
            usual = loop.own("metrics")
            assert (usual[SAMPLES] == STEPS).all()
            for sums in (same.own("metrics"), usual[[SQUARES, SQUARES + 1, EFFORT]]):
                np.testing.assert_allclose(sums, in_c.sums(), rtol=1e-9)
    print(tabulate(rows, ("control period, ms", "", "ns a slot and step", "share of the limit"), floatfmt=".1f"))
    print("\nmean squares of h, theta and the force: the same within 1e-9")


if __name__ == "__main__":
    main()
