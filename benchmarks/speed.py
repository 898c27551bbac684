"""Speed of the kernels, the environments and the tables: medians, and ratios taken within one run.

python benchmarks/speed.py
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
from tabulate import tabulate

import smo_gym
from smo_gym import CartPendulum, ObserverWrapper, SlidingModeObserver, VectorObserverWrapper
from smo_gym.observers import Period
from smo_gym.plant import advance

EVALUATE = Path(__file__).resolve().parent.parent / "agents" / "evaluate.py"


def median_seconds(work: Callable[[], object], repeats: int) -> float:
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def kernels() -> None:
    """One Runge-Kutta step of 1 ms of plant and observer, on one core."""
    smo_gym.set_threads(1)
    rows = []
    for n, steps in ((1, 20), (64, 20), (512, 20), (512, 1), (4096, 20)):
        x = np.random.default_rng(0).uniform(-1.0, 1.0, (4, n))
        params = np.repeat(CartPendulum().as_array()[:, None], n, axis=1)
        u, samples, y = np.full(n, 3.0), np.empty((steps, 2, n)), x[:2].copy()
        estimator = SlidingModeObserver().start(n, 0.001, 30.0, CartPendulum())
        start = x.copy()

        def plant(x=x, start=start, params=params, u=u, samples=samples) -> None:
            x[:] = start
            advance(x, params, u, 0.001, samples)

        def observer(estimator=estimator, y=y, samples=samples, u=u, x=x) -> None:
            estimator.update(Period(y, samples, u, x))

        times = [median_seconds(work, 300) / (n * steps) * 1e9 for work in (plant, observer)]
        rows.append((n, steps, *(f"{t:.1f}" for t in (*times, sum(times)))))
    header = ("slots", "steps a call", "plant, ns", "observer, ns", "both, ns a step and slot")
    print(tabulate(rows, header, disable_numparse=True), "\n")


def scalar() -> None:
    """A control period of 20 ms, 20 sub-steps, beside Gymnasium's Pendulum-v1 (one Euler step)."""
    envs = {
        "Pendulum-v1": gymnasium.make("Pendulum-v1"),
        "SMOPendulum-v0": gymnasium.make("SMOPendulum-v0"),
        "SMOPendulum-v0, observed": ObserverWrapper(gymnasium.make("SMOPendulum-v0")),
    }
    times: dict[str, list[float]] = {name: [] for name in envs}
    for _ in range(15):
        for name, env in envs.items():
            action = np.zeros(1, env.action_space.dtype)
            env.reset(seed=0)
            times[name].append(median_seconds(lambda env=env, action=action: env.step(action), 180))
    base = times["Pendulum-v1"]
    rows = [
        (
            name,
            f"{1e6 * statistics.median(t):.1f}",
            f"{statistics.median(a / b for a, b in zip(t, base, strict=True)):.2f}",
        )
        for name, t in times.items()
    ]
    print(tabulate(rows, ("scalar environment", "us a step", "times Pendulum-v1"), disable_numparse=True), "\n")


def vector() -> None:
    """Control periods of 20 ms a second, observer included."""
    rows = []
    for n in (1, 64, 1024, 4096):
        row = [str(n)]
        for threads in (1, 2):
            smo_gym.set_threads(threads)
            env = VectorObserverWrapper(gymnasium.make_vec("SMOPendulum-v0", n))
            env.reset(seed=0)
            action = np.zeros((n, 1))
            seconds = median_seconds(lambda env=env, action=action: env.step(action), 300)
            row += [f"{1e6 * seconds:.0f}", f"{n / seconds:,.0f}"]
        rows.append(row)
    header = ("slots", "us, 1 thread", "steps/s, 1 thread", "us, 2 threads", "steps/s, 2 threads")
    print(tabulate(rows, header, disable_numparse=True), "\n")


def tables() -> None:
    """Both controllers, both arms, 10 runs: the whole command, kernels cached."""
    with tempfile.TemporaryDirectory() as out:
        for name, scenarios in (("4 and 5", ["regulation", "initial-conditions"]), ("4, 5 and 7", ["all"])):
            command = [sys.executable, str(EVALUATE), "--scenario", *scenarios, "--out", out]
            seconds = median_seconds(lambda: subprocess.run(command, check=True, capture_output=True), 5)  # noqa: B023
            print(f"Tables {name}: {seconds:.1f} s")


if __name__ == "__main__":
    kernels()
    scalar()
    vector()
    tables()
