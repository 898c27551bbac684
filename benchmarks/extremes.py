"""Random plants, starts, gains and forces, extreme ones too: no observation outside its space without a flag.

    python benchmarks/extremes.py --runs 1000000

Exponents are drawn, not values, so that every order of magnitude is met. Half of the batches have no track limit.
"""

import argparse
import warnings
from dataclasses import dataclass

import gymnasium
import numpy as np

from smo_gym import SlidingModeObserver, VectorObserverWrapper

BATCH = 500


@dataclass(frozen=True)
class Found:
    """What some runs showed; all are counts of steps of a slot but ``runs``."""

    runs: int
    steps: int
    terminated: int
    lost: int
    """Estimates that started anew, with ``info["estimate_failed"]``."""
    unflagged: int
    """Observations outside the space, or not finite, without any flag."""


def tried(runs: int, periods: int, seed: int) -> Found:
    """Run so many slots for so many control periods each."""
    rng = np.random.default_rng(seed)
    counts = np.zeros(5, dtype=np.int64)
    for first in range(0, runs, BATCH):
        counts += _batch(min(BATCH, runs - first), periods, rng)
    return Found(*counts.tolist())


def _batch(n: int, periods: int, rng: np.random.Generator) -> np.ndarray:
    track = rng.choice([5.0, 1e200, np.inf, np.inf])
    observers = [_observer(rng) for _ in range(n)]
    env = gymnasium.make_vec(
        "SMOPendulum-v0",
        n,
        autoreset_mode="Disabled",
        control_period=0.004,
        horizon=4.0,
        force_limit=None,
        track_limit=track,
    )
    spread = rng.choice([0.3, 3.0])
    params = np.stack([*10.0 ** rng.uniform(-spread, spread, (3, n)), rng.uniform(-30.0, 30.0, n)], axis=1)
    state = _signed(rng, -3.0, rng.choice([0.3, 1.0, 2.0, 12.0, 150.0]), (n, 4))
    envs = VectorObserverWrapper(env, observers)
    envs.reset(options={"state": state, "params": params})
    counts = np.array([n, 0, 0, 0, 0])
    for _ in range(periods):
        force = _signed(rng, -3.0, rng.choice([1.5, 1.5, 4.0, 100.0]), (n, 1))
        observation, _, terminated, truncated, info = envs.step(force)
        outside = ~np.isfinite(observation).all(axis=1)  # stricter than the space, whose bounds are infinite
        flagged = terminated | truncated | info["estimate_failed"]
        counts += [0, n, terminated.sum(), info["estimate_failed"].sum(), (outside & ~flagged).sum()]
    return counts


def _observer(rng: np.random.Generator) -> SlidingModeObserver:
    """Gains over nine orders of magnitude; slopes as steep as the step allows for a force of 30 N."""
    m1, beta_1, beta_2 = (tuple((10.0 ** rng.uniform(-4.0, 5.0, 2)).tolist()) for _ in range(3))
    gains = {"m1": m1, "beta_1": beta_1, "beta_2": beta_2}
    loose = SlidingModeObserver(gains, slopes=(1e-9, 1e-9), xhat0=_signed(rng, -3.0, 3.0, 4))
    steepest = 1e-9 * loose.largest_step(30.0) / 0.001
    slope = min(steepest * rng.uniform(0.01, 0.99), 1e6)
    return SlidingModeObserver(gains, slopes=(slope, slope), xhat0=loose.xhat0)


def _signed(rng: np.random.Generator, low: float, high: float, shape: int | tuple[int, ...]) -> np.ndarray:
    return rng.choice([-1.0, 1.0], shape) * 10.0 ** rng.uniform(low, high, shape)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1_000_000)
    parser.add_argument("--periods", type=int, default=25, help="control periods of 4 ms in a run (default 25)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("error")
    found = tried(args.runs, args.periods, args.seed)
    print(
        f"{found.runs:,} runs, {found.steps:,} steps: {found.terminated:,} terminated, {found.lost:,} lost estimates "
        f"that started anew; observations outside their space without a flag: {found.unflagged}"
    )


if __name__ == "__main__":
    main()
