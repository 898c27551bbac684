"""The block of a sensor: all flaws in their order against plain Python, and bits that depend on the episode alone."""

import math
import os
import pickle
import subprocess
import sys

import numba
import numpy as np
import pytest
from conftest import ROOT
from test_sensors import DT, coasting

from smo_gym.kernels.interpreted import uniform
from smo_gym.kernels.noise import two_normals
from smo_gym.kernels.sensing import COUNT, KEY
from smo_gym.sensors import Sensor

_two_normals = numba.njit(lambda a, b: two_normals(a, b))
ALL = Sensor(
    scale=(1.01, 0.99),
    bias=(0.003, -0.02),
    dead_zone=(0.1, -0.2),
    dead_width=(0.05, 0.4),
    stuck=(0.03, 0.02),
    stuck_samples=(3, 5),
    noise=(0.002, 0.01),
    speed_noise=(0.001, 0.003),
    resolution=(0.0005, 2 * math.pi / 2048),
    update_period=(3 * DT, 2 * DT),
    delay=(7, 12),
    delay_least=(2, 12),
    hold=(0.5, 0.0),
    dropout=(0.05, 0.02),
    dropout_samples=(2, 4),
    jitter=0.2 * DT,
)
"""All at once; theta's delay is fixed."""


def definition(sensor, key, states):
    """Readings (samples, 2) of one episode, written down from the docstring of Sensor, one sample after the other."""
    least = sensor.delay_least or sensor.delay
    outside, stuck_at, held, lag = [None, None], [None, None], [None, None], [*least]
    stuck_left, lost_left, before = [0, 0], [0, 0], ([], [])
    delivered = []
    for k, x in enumerate(states):

        def draw(stream, k=k):
            return uniform(float(key), 64.0 * k + stream)

        tau = 0.0
        if sensor.jitter:
            tau = min(max(sensor.jitter * _two_normals(draw(2), draw(3))[0], -0.5 * DT), 0.5 * DT)
        normals = _two_normals(draw(0), draw(1))
        now = []
        for c in range(2):
            y = sensor.scale[c] * (x[c] + tau * x[2 + c]) + sensor.bias[c]
            if sensor.dead_width[c]:
                turn = sensor.scale[c] * 2 * math.pi
                zones = math.floor((y - sensor.dead_zone[c]) / turn) if c == 1 else 0
                beyond = y - sensor.dead_zone[c] - turn * zones
                if 0 <= beyond < sensor.dead_width[c]:
                    y = sensor.dead_zone[c] + 2 * math.pi * zones if k == 0 else outside[c]
                elif c == 1:
                    y = y - (turn - 2 * math.pi) * (zones + 1.0)
            outside[c] = y
            if stuck_left[c] == 0 and k > 0 and draw(4 + c) < sensor.stuck[c]:
                stuck_left[c] = sensor.stuck_samples[c]
            if stuck_left[c] > 0:
                stuck_left[c] -= 1
                y = stuck_at[c]
            stuck_at[c] = y
            y = y + (sensor.noise[c] + sensor.speed_noise[c] * abs(x[2 + c])) * normals[c]
            if sensor.resolution and sensor.resolution[c]:
                y = sensor.resolution[c] * np.rint(y / sensor.resolution[c])
            every = round(sensor.update_period[c] / DT)
            if every and k % every:
                y = held[c]
            held[c] = y
            before[c].append(y)
            if least[c] < sensor.delay[c] and not (k > 0 and draw(8 + c) < sensor.hold[c]):
                lag[c] = least[c] + math.floor(draw(6 + c) * (sensor.delay[c] - least[c] + 1))
            y = before[c][max(k - lag[c], 0)]
            if lost_left[c] == 0 and k > 0 and draw(10 + c) < sensor.dropout[c]:
                lost_left[c] = sensor.dropout_samples[c]
            if lost_left[c] > 0:
                lost_left[c] -= 1
                y = delivered[-1][c]
            now.append(y)
        delivered.append(now)
    return np.array(delivered)


def drawn(seed):
    """A sensor of which each flaw is there or not."""
    rng = np.random.default_rng(seed)
    names = ["scale", "dead_width", "stuck", "noise", "speed_noise", "resolution", "update_period", "dropout", "jitter"]
    chosen = {name: getattr(ALL, name) for name in names if rng.random() < 0.5}
    if rng.random() < 0.7:
        chosen |= {"delay": tuple(rng.integers(0, 9, 2).tolist())}
    return Sensor(stuck_samples=ALL.stuck_samples, dropout_samples=ALL.dropout_samples, **chosen)


def cases(n):
    """States that depend on the slot alone, and keys."""
    draws = [np.random.default_rng(slot) for slot in range(n)]
    x = np.array([[rng.uniform(-0.3, 0.3), rng.uniform(-7, 7), 2.0, rng.uniform(-20, 20)] for rng in draws]).T.copy()
    return x, np.array([float(rng.integers(0, 2**52)) for rng in draws])


@pytest.mark.parametrize("sensor", [ALL, *map(drawn, range(12))])
def test_all_flaws_in_their_order(sensor):
    x, keys = cases(3)
    loop = coasting(sensor, x, keys)
    states, readings = [loop.x.copy()], [loop.y.copy()]
    for k in range(300):
        loop.run(k)
        states.append(loop.x.copy())
        readings.append(loop.y.copy())
    for slot in range(3):
        expected = definition(sensor, keys[slot], [x[:, slot].tolist() for x in states])
        assert np.array_equal([y[:, slot] for y in readings], expected)


def shown(n, periods=12, chunk=12, sensor=ALL):
    x, keys = cases(n)
    loop = coasting(sensor, x, keys, substeps=5)
    for k in range(0, periods, chunk):
        loop.run(k, chunk)
    return loop


@pytest.mark.parametrize("n", [1, 5, 7, 64, 65, 130])
def test_a_slot_has_the_same_bits_in_a_loop_of_any_size(n):
    assert np.array_equal(shown(n).rows, shown(200).rows[:, :n])


@pytest.mark.parametrize("chunk", [1, 3, 4])
def test_how_many_periods_a_call_drives_changes_no_bit(chunk):
    assert shown(70, chunk=chunk).rows.tobytes() == shown(70).rows.tobytes()


def test_threads_change_no_bit(monkeypatch):
    monkeypatch.setattr("smo_gym.kernels.batch._WORTH_A_THREAD", 0.0)
    found = []
    for threads in (1, 3):
        monkeypatch.setattr("smo_gym.kernels.batch._pool.threads", threads)
        found.append(shown(270).rows.tobytes())
    assert found[0] == found[1]


def test_a_copy_goes_on_as_the_one_it_is_of():
    loop = shown(5)
    twin = pickle.loads(pickle.dumps(loop))
    loop.run(12, 3)
    twin.run(12, 3)
    assert twin.rows.tobytes() == loop.rows.tobytes()


def test_an_episode_reads_the_same_whenever_it_begins():
    x, keys = cases(70)
    loop, late = coasting(ALL, x, keys), np.arange(70) % 3 == 1
    loop.run(0, 17)
    loop.start(late, x[:, late])
    assert (loop.own("sensor")[COUNT] == np.where(late, 1.0, 18.0)).all()
    loop.run(17, 40)
    fresh = coasting(ALL, x, keys)
    fresh.run(0, 40)
    assert np.array_equal(loop.y[:, late], fresh.y[:, late])
    fresh.run(40, 17)
    assert np.array_equal(loop.rows[:, ~late], fresh.rows[:, ~late])


def test_another_key_is_another_episode():
    x, keys = cases(5)
    loop = coasting(ALL, x, keys)
    loop.own("sensor")[KEY] += 1.0
    loop.run(0, 30)
    same = coasting(ALL, x, keys)
    same.run(0, 30)
    assert (loop.y != same.y).any(axis=0).all()


PROBE = """
import sys
sys.path[:0] = ["tests", "tests/kernels"]
from test_sensing import shown
print(shown(3).rows.tobytes().hex())
"""


def test_without_a_compiler_the_bits_are_the_same():
    place = os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, env=place)
    assert done.stdout.strip() == shown(3).rows.tobytes().hex()
