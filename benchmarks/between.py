"""What sensors, actuators, friction and disturbances cost: times of an exact loop and environment, by turns with it.

    python benchmarks/between.py

One thread, its CPU time. A ratio is the median over rounds of two times that were taken one right after the other.
"""

import statistics
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from closed_loop import closed_loop, run
from speed import call, show, steps_of

import smo_gym
from smo_gym import ObserverWrapper, VectorObserverWrapper

ROUNDS = 40
OPTIONS: dict[str, dict[str, Any]] = {
    "exact": {},
    "counts": {"sensor": "encoders"},
    "counts and noise": {"sensor": {"resolution": (1e-4, 1.5e-3), "noise": (1e-4, 7.5e-4)}},
    "a motor with lag": {"actuator": "lag"},
    "Coulomb friction": {"friction": {"cart_coulomb": 0.5, "pivot_viscous": 3.5e-4}},
    "a push": {"disturbance": "push"},
    "all but exact": {"sensor": "as5600", "actuator": "lag", "friction": "cart-pole", "disturbance": "cart-pole"},
}


def ratios(works: Mapping[str, Callable[[], float]]) -> dict[str, float]:
    """How many times as long as the first each takes."""
    for work in works.values():
        work()  # compiles
    first, *others = works.values()
    rounds = [[work() / base for work in others] for base in (first() for _ in range(ROUNDS))]
    medians = map(statistics.median, zip(*rounds, strict=True))
    return dict(zip(works, (1.0, *medians), strict=True))


def main() -> None:
    smo_gym.set_threads(1)
    loops = {
        period: {
            name: run(closed_loop("lqr", 512, period, **options), steps_of(512)) for name, options in OPTIONS.items()
        }
        for period in (0.001, 0.02)
    }
    scalar = {
        name: partial(call, ObserverWrapper(gymnasium.make("SMOPendulum-v0", **options)), np.zeros(1), 180)
        for name, options in OPTIONS.items()
    }
    vector = {
        name: partial(
            call, VectorObserverWrapper(gymnasium.make_vec("SMOPendulum-v0", 64, **options)), np.zeros((64, 1)), 30
        )
        for name, options in OPTIONS.items()
    }
    steps = [{name: partial(work, time.thread_time) for name, work in each.items()} for each in (scalar, vector)]
    told = [ratios(works) for works in (*loops.values(), *steps)]
    header = ("times exact", "loop, 1 ms", "loop, 20 ms", "scalar step", "vector step, 64 slots")
    show(header, [(name, *(each[name] for each in told)) for name in OPTIONS], ".2f")


if __name__ == "__main__":
    main()
