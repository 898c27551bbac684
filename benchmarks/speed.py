"""Speed of the kernels, the closed loop, the environments and the tables: the least of many, and ratios within one run.

    python benchmarks/speed.py
    python benchmarks/speed.py --long    # the tables of 200 runs, too

One core's times are CPU time; those of two threads and of commands are wall times, which other work makes longer.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from closed_loop import DT, closed_loop, least, run
from tabulate import tabulate

import smo_gym
from smo_gym import CartPendulum, ObserverWrapper, SlidingModeObserver, VectorObserverWrapper
from smo_gym.loop import Loop
from smo_gym.plant import moving

EVALUATE = Path(__file__).resolve().parent.parent / "agents" / "evaluate.py"
SLOTS = (64, 512, 4096)
SLOT_STEPS = 200_000


def show(header: Sequence[str], rows: Sequence[Sequence[Any]], digits: str) -> None:
    print(tabulate(rows, header, floatfmt=digits), "\n", flush=True)


def steps_of(n: int) -> int:
    """So many that a call takes some milliseconds, a multiple of 20."""
    return max(20, SLOT_STEPS // n // 20 * 20)


def kernels() -> None:
    """A Runge-Kutta step of 1 ms of plant and observer."""
    plant = CartPendulum()
    observer = SlidingModeObserver()
    rows = []
    for n, substeps in ((1, 20), *((n, 20) for n in SLOTS), (512, 1)):
        params = np.repeat(plant.as_array()[:, None], n, axis=1)
        parts = {"plant": moving(params, DT), "observer": observer.part(n, DT, 30.0, plant)}
        works = {name: run(Loop(n, substeps, {name: part}), steps_of(n)) for name, part in parts.items()}
        works["both"] = run(Loop(n, substeps, parts), steps_of(n))
        rows.append((n, substeps, *least(works, 20).values()))
    show(("slots", "steps a period", "plant, ns a slot and step", "observer", "both"), rows, ".1f")


def loops() -> None:
    """The closed loop with everything in it: force limit, encoders, observer, guard, metrics and judge."""
    rows = []
    for n in SLOTS:
        row: list[float] = [n]
        for control_period in (0.001, 0.02):
            works = {law: run(closed_loop(law, n, control_period), steps_of(n)) for law in ("lqr", "smc")}
            row += least(works, 20).values()
        rows.append(row)
    names = ("LQR, 1 ms, ns a slot and step", "SMC, 1 ms", "LQR, 20 ms", "SMC, 20 ms")
    show(("slots", *names), rows, ".1f")


def call(env: gymnasium.Env[Any, Any], action: Any, calls: int, clock: Callable[[], float]) -> float:
    """Microseconds of a step from a reset on."""
    env.reset(seed=0)
    began = clock()
    for _ in range(calls):
        env.step(action)
    return 1e6 * (clock() - began) / calls


def scalar() -> None:
    """A control period of 20 ms, 20 sub-steps, beside Gymnasium's Pendulum-v1 (one Euler step)."""
    envs = {
        "Pendulum-v1": gymnasium.make("Pendulum-v1"),
        "SMOPendulum-v0": gymnasium.make("SMOPendulum-v0"),
        "SMOPendulum-v0, observed": ObserverWrapper(gymnasium.make("SMOPendulum-v0")),
    }
    works = {
        name: partial(call, env, np.zeros(1, env.action_space.dtype), 180, time.thread_time)
        for name, env in envs.items()
    }
    told = least(works, 40)
    rows = [(name, t, t / told["Pendulum-v1"]) for name, t in told.items()]
    show(("scalar environment", "us a step", "times Pendulum-v1"), rows, ".2f")


def vector() -> None:
    """Control periods of 20 ms, observer included."""
    rows = []
    for n in (8, 64, 1024):
        env = VectorObserverWrapper(gymnasium.make_vec("SMOPendulum-v0", n))
        row = [str(n)]
        for threads in (1, 2):
            smo_gym.set_threads(threads)
            work = partial(call, env, np.zeros((n, 1)), max(10, 20_000 // n // 10), time.perf_counter)
            seconds = 1e-6 * least({"": work}, 40)[""]
            row += [f"{1e6 * seconds:.0f}", f"{n / seconds:,.0f}"]
        rows.append(row)
    smo_gym.set_threads(1)
    header = ("slots", "us, 1 thread", "steps/s, 1 thread", "us, 2 threads", "steps/s, 2 threads")
    print(tabulate(rows, header, disable_numparse=True), "\n", flush=True)


def tables(runs: Sequence[int]) -> None:
    """Both controllers, both arms: the whole command, kernels cached, nothing kept from before."""
    rows = []
    for count in runs:
        for name, scenarios in (("4 and 5", ["regulation", "initial-conditions"]), ("4, 5 and 7", ["all"])):
            times = [command("--scenario", *scenarios, "--runs", str(count)) for _ in range(3 if count < 100 else 1)]
            rows.append((name, count, *map(min, zip(*times, strict=True))))
    show(("tables", "runs", "s", "s of CPU time"), rows, ".1f")


def command(*arguments: str) -> tuple[float, float]:
    """Seconds that an evaluation takes: on the wall, and of the processor."""

    def used() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    with tempfile.TemporaryDirectory() as out:
        began, before = time.perf_counter(), used()
        subprocess.run([sys.executable, str(EVALUATE), *arguments, "--out", out], check=True, capture_output=True)
        return time.perf_counter() - began, used() - before


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", action="store_true", help="the tables of 200 runs, too")
    args = parser.parse_args()
    smo_gym.set_threads(1)
    kernels()
    loops()
    scalar()
    vector()
    tables([10, 200] if args.long else [10])


if __name__ == "__main__":
    main()
