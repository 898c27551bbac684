"""The plant with friction and back-EMF beside recordings of a real cart pole: half a second at a time, from one state.

    python benchmarks/cart_pole.py FOLDER [--figure FILE.png]

The recordings are the folder ``test`` of CartPoleSimulation's recordings V1 (SensorsINI, MIT licence): swing-ups, about
49 positions a second and the motor's command Q in [-1, 1]. No speed was recorded: the state that a window begins with
is fitted to its positions, and nothing else is. Windows keep clear of the potentiometer's dead zone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from smo_gym import CartPendulum
from smo_gym.friction import Friction, rubbing
from smo_gym.kernels.blocks import FORCE
from smo_gym.loop import Loop
from smo_gym.typing import Array

PERIOD, SUBSTEPS, SAMPLES = 0.02029, 20, 25
SCALE, DEAD_ZONE = 0.96, (1.0, 1.35)
"""Radians in a radian of reading, and the readings between which the potentiometer says nothing."""

# Fitted to 60 other swing-ups: theta'' = 37.27 sin theta - 3.99 cos theta h'' - 0.078 theta' and, without the rod,
# h'' = 9.564 (Q + 0.003) - 16.2 h' - 0.182 sgn h', on which the rod acts as m l / (M_c + m) = 0.0062 m.
# Positions say accelerations and no forces; the mass that makes newtons of them is the 0.087 kg of the rig's settings,
# of whose uniform rod three quarters are a bob at l.
GRAVITY, BOB_MASS = 9.81, 0.75 * 0.087
LENGTH = GRAVITY / 37.27
MASS = BOB_MASS * LENGTH / 0.0062
"""M_c + m in kg: cart, belt, gear and rotor."""
FRICTION = Friction(cart_coulomb=0.182 * MASS, pivot_viscous=0.078 * BOB_MASS * LENGTH**2)
PLANT = CartPendulum(MASS - BOB_MASS, BOB_MASS, LENGTH, GRAVITY, FRICTION)
UNIT, BACK_EMF, BIAS = 9.564 * MASS, 16.2 * MASS, 0.003
"""N at Q = 1; N per m/s, with all viscous friction of the cart; and what the recorded Q lacks."""
TOLERANCE = np.array([[0.005], [0.02]])
"""How much of h in m and theta in rad weigh alike where a state is fitted."""


def windows(files: Iterable[Path]) -> tuple[Array, Array]:
    """Positions [h, theta] (n, 2, SAMPLES + 1) and commands (n, SAMPLES) of n windows; h is mirrored."""
    positions, commands = [], []
    for file in files:
        data = np.genfromtxt(file, delimiter=",", skip_header=2)
        reading, h, Q = np.unwrap(data[:, 1]), -data[:, 5], -data[:, 7]
        turns = np.floor((reading - 1.15) / (2.0 * np.pi)) + 1.0
        theta = SCALE * reading + 2.0 * np.pi * (1.0 - SCALE) * turns
        turned = np.mod(reading + np.pi, 2.0 * np.pi) - np.pi
        missing = np.round(np.diff(data[:, 0], prepend=data[0, 0] - PERIOD) / PERIOD) != 1.0
        bad = (turned > DEAD_ZONE[0]) & (turned < DEAD_ZONE[1]) | missing
        k = SAMPLES
        while k + SAMPLES + 12 < len(h):
            if bad[k - 16 : k + SAMPLES + 4].any():  # the reading recovers for a third of a second
                k += 1
                continue
            positions.append([h[k : k + SAMPLES + 1], theta[k : k + SAMPLES + 1]])
            commands.append(Q[k : k + SAMPLES])
            k += SAMPLES
    return np.array(positions), np.array(commands)


def simulated(x0: Array, commands: Array) -> Array:
    """Positions (n, 2, SAMPLES + 1) from states (4, n) under commands (n, SAMPLES)."""
    n = x0.shape[1]
    params, friction = (np.repeat(each.as_array()[:, None], n, axis=1) for each in (PLANT, FRICTION))
    loop = Loop(n, 1, {"plant": rubbing(params, PERIOD / SUBSTEPS, friction, BACK_EMF)})
    loop.start(slice(None), x0)
    found = [x0[:2]]
    for Q in commands.T:
        for _ in range(SUBSTEPS):
            loop.rows[FORCE] = UNIT * (Q - BIAS)
            loop.run()
        found.append(loop.x[:2].copy())
    return np.transpose(found, (2, 1, 0))


def overlaid(positions: Array, commands: Array) -> Array:
    """Positions simulated from the states at the beginning that fit best, found by Gauss and Newton."""
    n, small = len(positions), 1e-5
    speeds = (positions[:, :, 2] - positions[:, :, 0]) / (2.0 * PERIOD)
    x0 = np.concatenate([positions[:, :, 0], speeds], axis=1).T
    for _ in range(4):
        shifted = np.concatenate([x0, *(x0 + small * unit[:, None] for unit in np.eye(4))], axis=1)
        found = simulated(shifted, np.tile(commands, (5, 1))).reshape(5, n, 2, -1) / TOLERANCE
        slopes = (found[1:] - found[0]) / small
        for i, error in enumerate(positions / TOLERANCE - found[0]):
            x0[:, i] += np.linalg.lstsq(slopes[:, i].reshape(4, -1).T, error.ravel(), rcond=None)[0]
    return simulated(x0, commands)


def figure(positions: Array, found: Array, rms: Array) -> Any:
    """Three windows side by side: recorded points, computed lines."""
    from matplotlib.figure import Figure

    farthest = np.ptp(positions, axis=2).argmax(axis=0)
    chosen = {
        "cart goes farthest": farthest[0],
        "rod turns farthest": farthest[1],
        "median difference in h": np.argsort(rms[:, 0])[len(rms) // 2],
    }
    drawn = Figure(figsize=(7.2, 3.6), layout="constrained")
    axes = drawn.subplots(2, len(chosen), sharex=True)
    t = PERIOD * np.arange(SAMPLES + 1)
    for column, (title, i) in enumerate(chosen.items()):
        for ax, recorded, computed, factor in zip(axes[:, column], positions[i], found[i], (100.0, 1.0), strict=True):
            ax.plot(t, factor * computed, color="#0072b2", label="computed")
            ax.plot(t, factor * recorded, ".", color="black", markersize=4, label="recorded")
            ax.grid(alpha=0.3)
        axes[0, column].set_title(title, fontsize=10)
        axes[1, column].set_xlabel("t in s")
    axes[0, 0].set_ylabel("h in cm")
    axes[1, 0].set_ylabel(r"$\theta$ in rad")
    axes[0, 0].legend(frameon=False)
    return drawn


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    positions, commands = windows(sorted(args.folder.glob("*.csv")))
    found = overlaid(positions, commands)
    rms = np.sqrt(((found - positions) ** 2).mean(axis=2))
    print(f"{len(rms)} windows of {SAMPLES * PERIOD:.2f} s: root mean square of the difference")
    print("           median    all  worst")
    for name, unit, factor, each in (("h", "mm", 1e3, rms[:, 0]), ("theta", "mrad", 1e3, rms[:, 1])):
        values = np.array([np.median(each), np.sqrt((each**2).mean()), each.max()]) * factor
        print(f"{name:5} {unit:4} " + " ".join(f"{value:6.2f}" for value in values))
    if args.figure:
        figure(positions, found, rms).savefig(args.figure, dpi=150)


if __name__ == "__main__":
    main()
