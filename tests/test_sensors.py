"""Sensors: each flaw against its definition."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from smo_gym.kernels.blocks import STAMP, block, four, put_four
from smo_gym.kernels.blocks import X as STATE
from smo_gym.loop import Loop, Part
from smo_gym.sensors import KEY, Sensor

DT = 2.0**-10
SLOTS, SAMPLES = 1000, 1000
N = SLOTS * SAMPLES
SIGMAS = 5.0
STILL = np.zeros((4, SLOTS))


@block
def _coast(signals, own, lanes):
    for i in range(lanes):
        h, theta, v, omega = four(signals, STATE, i)
        put_four(signals, STATE, i, (h + DT * v, theta + DT * omega, v, omega))


def coasting(sensor, x, keys=None, substeps=1):
    """Slots of constant speed from states x (4, n), measured; keys are 0, 1, ... where none are given."""
    n = x.shape[1]
    part = sensor.part(n, DT)
    rows = part.rows.copy()
    if len(rows):
        rows[KEY] = np.arange(n) if keys is None else keys
    loop = Loop(n, substeps, {"plant": Part(np.empty((0, n)), sample=_coast), "sensor": replace(part, rows=rows)})
    loop.start(slice(None), x)
    return loop


def watched(sensor, x, samples=SAMPLES, keys=None):
    """States (samples + 1, 4, n), readings (samples + 1, 2, n) and stamps (samples + 1, n) of such slots."""
    loop = coasting(sensor, x, keys)
    seen = [(loop.x.copy(), loop.y.copy(), loop.rows[STAMP].copy())]
    for k in range(samples):
        loop.run(k)
        seen.append((loop.x.copy(), loop.y.copy(), loop.rows[STAMP].copy()))
    return tuple(np.array(each) for each in zip(*seen, strict=True))


def moving(speed=1.0, n=SLOTS):
    """Slots that all begin at 0 and move, of each reading the position tells the sample."""
    x = np.zeros((4, n))
    x[2:] = speed
    return x


def near(found, expected, deviation):
    return abs(found - expected) < SIGMAS * deviation


def uncorrelated(a, b):
    return abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) * math.sqrt(a.size) < SIGMAS


def test_without_settings_readings_are_the_positions():
    x, y, _ = watched(Sensor(), moving(n=5), 20)
    assert np.array_equal(y, x[:, :2])


def test_scale_and_bias():
    x, y, _ = watched(Sensor(scale=(1.1, 0.9), bias=(0.01, -0.2)), moving(n=5), 20)
    assert np.array_equal(y[:, 0], 1.1 * x[:, 0] + 0.01)
    assert np.array_equal(y[:, 1], 0.9 * x[:, 1] - 0.2)


@pytest.mark.parametrize("keys", [np.arange(SLOTS), 2**52 - 1 - 7 * np.arange(SLOTS)])
def test_noise_is_white_normal_and_of_each_slot_and_channel_its_own(keys):
    sensor = Sensor(noise=(0.002, 0.03))
    assert sensor.random
    _, y, _ = watched(sensor, STILL, SAMPLES - 1, keys)
    z = y / np.array([0.002, 0.03])[:, None]
    for each in (z[:, 0], z[:, 1]):
        assert near(each.mean(), 0.0, 1.0 / math.sqrt(N))
        assert near(each.var(), 1.0, math.sqrt(2.0 / N))
        assert stats.kstest(each.ravel(), "norm").pvalue > 1e-5
        assert near(each[0].var(), 1.0, math.sqrt(2.0 / SLOTS))  # the first reading is a measured one
        for lag in (1, 2, 5, 20):
            assert uncorrelated(each[lag:], each[:-lag])
            assert uncorrelated(each[:, lag:], each[:, :-lag])
    assert uncorrelated(z[:, 0], z[:, 1])
    assert uncorrelated(z[:, 0] ** 2, z[:, 1] ** 2)


def test_speed_makes_noise_larger():
    x = np.zeros((4, SLOTS))
    x[2], x[3] = np.linspace(-2.0, 2.0, SLOTS), np.linspace(5.0, -5.0, SLOTS)
    state, y, _ = watched(Sensor(noise=(0.1, 0.0), speed_noise=(0.2, 0.3)), x)
    deviation = np.array([0.1 + 0.2 * np.abs(x[2]), 0.3 * np.abs(x[3])])
    z = (y - state[:, :2]) / deviation
    assert near(z.var(), 1.0, math.sqrt(2.0 / z.size))
    assert np.abs(z.var(axis=0) - 1.0).max() < 6.0 * math.sqrt(2.0 / SAMPLES)


def test_resolution_leaves_a_uniform_error():
    x = np.zeros((4, SLOTS))
    x[2], x[3] = np.random.default_rng(0).uniform(1.0, 10.0, (2, SLOTS))
    counts = np.array([1e-3, 2.0 * math.pi / 4096])
    sensor = Sensor(resolution=tuple(counts))
    assert not sensor.random
    state, y, _ = watched(sensor, x)
    number = y / counts[:, None]
    assert np.abs(number - np.rint(number)).max() < 1e-9
    error = ((y - state[:, :2]) / counts[:, None])[1:]
    assert np.abs(error).max() < 0.5 + 1e-9
    for each in (error[:, 0], error[:, 1]):
        assert stats.kstest(each.ravel()[::7], stats.uniform(-0.5, 1.0).cdf).pvalue > 1e-5
        assert each.var() == pytest.approx(1.0 / 12.0, rel=0.01)


@pytest.mark.parametrize("delay", [(1, 0), (0, 3), (20, 7)])
def test_a_fixed_delay_is_exact_to_the_sample(delay):
    sensor = Sensor(delay=delay)
    assert not sensor.random
    x, y, _ = watched(sensor, moving(n=5), 50)
    for c, d in enumerate(delay):
        assert np.array_equal(y[:, c], x[np.maximum(np.arange(51) - d, 0), c])


@pytest.mark.parametrize("hold", [0.0, 0.7])
def test_a_drawn_delay_is_even_and_may_be_kept(hold):
    sensor = Sensor(delay=(9, 4), delay_least=(3, 0), hold=(hold, hold))
    assert sensor.random
    x, y, _ = watched(sensor, moving())
    lags = np.rint((x[:, :2] - y) / DT)[10:]
    for c, (least, most) in enumerate(((3, 9), (0, 4))):
        values = most - least + 1
        thinned = lags[::20, c]  # 0.7^20: as good as independent
        found = [np.count_nonzero(thinned == lag) for lag in range(least, most + 1)]
        assert sum(found) == thinned.size
        assert stats.chisquare(found).pvalue > 1e-5
        same = hold + (1.0 - hold) / values
        kept = lags[1:, c] == lags[:-1, c]
        # whether one is kept depends on no other
        assert near(kept.mean(), same, math.sqrt(same * (1.0 - same) / kept.size))
    if hold == 0.0:
        assert uncorrelated(lags[:, 0], lags[:, 1])


def runs_of(struck):
    """Lengths of the runs of True along the first axis that have begun and ended within, of all slots."""
    edges = np.diff(struck.astype(int), axis=0).T
    lengths = []
    for each in edges:
        begins, ends = np.flatnonzero(each == 1), np.flatnonzero(each == -1)
        ends = ends[ends > begins[0]] if len(begins) else ends[:0]
        lengths.append(ends - begins[: len(ends)])
    return np.concatenate(lengths)


@pytest.mark.parametrize("fault", ["stuck", "dropout"])
@pytest.mark.parametrize(("chance", "samples"), [(0.1, 1), (0.02, 5)])
def test_a_fault_strikes_as_often_and_for_as_long_as_it_should(fault, chance, samples):
    sensor = Sensor(**{fault: (chance, 0.0), f"{fault}_samples": (samples, 1)})
    assert sensor.random
    x, y, _ = watched(sensor, moving())
    assert np.array_equal(y[:, 1], x[:, 1])
    struck = y[:, 0] != x[:, 0]
    assert not struck[0].any()
    expected = np.where(struck[1:], y[:-1, 0], x[1:, 0])
    assert np.array_equal(y[1:, 0], expected)
    begins = chance / (1.0 - chance + chance * samples)  # strikes per sample, once it does not matter how all began
    share = struck[200:].mean()
    assert near(share, begins * samples, samples * math.sqrt(begins / (N - 200 * SLOTS)))
    runs = runs_of(struck)
    assert (runs % samples == 0).all()
    strikes = runs // samples  # in a row: geometric
    assert near(strikes.mean(), 1.0 / (1.0 - chance), math.sqrt(chance / len(strikes)) / (1.0 - chance))
    assert near((strikes == 1).mean(), 1.0 - chance, math.sqrt(chance * (1.0 - chance) / len(strikes)))


def test_what_always_strikes_lets_the_first_reading_through():
    for fault in ("stuck", "dropout"):
        x, y, _ = watched(Sensor(**{fault: (1.0, 1.0)}), moving(n=5), 20)
        assert (y == x[0, :2]).all()


def test_between_updates_a_reading_is_held():
    every = np.array([4, 10])
    sensor = Sensor(update_period=tuple(every * DT), noise=(1.0, 1.0))
    _, y, _ = watched(sensor, STILL, SAMPLES - 1)
    for c, period in enumerate(every):
        updates = y[::period, c]
        assert np.array_equal(y[:, c], np.repeat(updates, period, axis=0)[:SAMPLES])
        assert uncorrelated(updates[1:], updates[:-1])
        for lag in (1, 2, 3, period):
            found = np.mean(y[lag:, c] * y[:-lag, c])
            # a triangle; a mean of n held values varies like that of n / period free ones
            assert near(found, max(0.0, 1.0 - lag / period), 2.0 * math.sqrt(period / N))


def test_updates_begin_when_an_episode_begins():
    x, y, _ = watched(Sensor(update_period=(3 * DT, DT)), moving(n=5), 20)
    assert np.array_equal(y[:, 0], x[np.arange(21) // 3 * 3, 0])
    assert np.array_equal(y[:, 1], x[:, 1])


@pytest.mark.parametrize("deviation", [0.05 * DT, DT])
def test_jitter_is_a_shift_in_time_that_is_told(deviation):
    sensor = Sensor(jitter=deviation)
    assert sensor.random
    x, y, tau = watched(sensor, moving(2.0), SAMPLES - 1)
    assert np.array_equal(y, x[:, :2] + tau[:, None] * x[:, 2:])
    cut = np.abs(tau) == 0.5 * DT
    assert np.abs(tau).max() <= 0.5 * DT
    outside = 2.0 * stats.norm.sf(0.5 * DT / deviation)
    assert near(cut.mean(), outside, math.sqrt(outside * (1.0 - outside) / N) + 1e-12)
    assert (
        stats.kstest(tau[~cut][:100_000], stats.truncnorm(*np.array([-0.5, 0.5]) * DT / deviation, 0, deviation).cdf)[1]
        > 1e-5
    )
    assert uncorrelated(tau[1:], tau[:-1])
    assert uncorrelated(tau[:, 1:], tau[:, :-1])


def test_in_a_dead_zone_the_last_reading_stays_in_every_turn_of_the_rod():
    x = np.zeros((4, 2))
    x[2], x[3] = 1.0, (9.0, -9.0)
    sensor = Sensor(dead_zone=(0.5, 2.0), dead_width=(0.2, 0.3))
    assert not sensor.random
    state, y, _ = watched(sensor, x, 4000)
    h, theta = state[:, 0], state[:, 1]
    inside = (theta - 2.0) % (2.0 * math.pi) < 0.3
    assert len(runs_of(inside)) >= 8
    last = np.maximum.accumulate(np.where(inside, 0, np.arange(4001)[:, None]), axis=0)
    assert np.array_equal(y[:, 1], np.take_along_axis(theta, last, axis=0))
    gap = (h >= 0.5) & (h < 0.7)
    assert np.array_equal(y[~gap[:, 0], 0], h[~gap[:, 0]])
    assert (y[gap[:, 0], 0] == h[:, 0][h[:, 0] < 0.5].max()).all()


def test_a_potentiometer_whose_scale_makes_up_for_its_gap_reads_whole_turns():
    scale = 1.0 / 0.96
    gap = 2.0 * math.pi * (scale - 1.0)
    x = np.zeros((4, 2))
    x[3] = (9.0, -9.0)
    state, y, _ = watched(Sensor(scale=(1.0, scale), dead_zone=(0.0, 1.15), dead_width=(0.0, gap)), x, 4000)
    theta, reading = state[:, 1], y[:, 1]
    turns = theta / (2.0 * math.pi)
    whole = np.abs(turns - np.rint(turns)) < 9e-4
    assert len(runs_of(whole)) >= 10
    error = reading - (2.0 * math.pi * np.rint(turns) + scale * (theta - 2.0 * math.pi * np.rint(turns)))
    np.testing.assert_allclose(error[whole], 0.0, atol=1e-12)
    steps = np.abs(np.diff(reading, axis=0))
    assert steps.max() < 2.0 * 9.0 * DT * scale  # it goes on where it stuck, to a step
    assert (steps[5:] == 0.0).mean() == pytest.approx(0.04, abs=0.004)


def test_who_begins_in_a_dead_zone_reads_where_it_begins():
    x = np.array([[0.6, 0.4], [2.1 + 4.0 * math.pi, 2.1 - 4.0 * math.pi], [0.0, 0.0], [0.0, 0.0]])
    _, y, _ = watched(Sensor(dead_zone=(0.5, 2.0), dead_width=(0.2, 0.3)), x, 3)
    assert (y[:, 0] == [0.5, 0.4]).all()
    assert y[:, 1] == pytest.approx(np.tile([2.0 + 4.0 * math.pi, 2.0 - 4.0 * math.pi], (4, 1)), abs=1e-14)
    assert (y[:, 1] == y[0, 1]).all()


def test_runs_that_have_ended_keep_their_last_reading():
    loop = coasting(Sensor(noise=(0.1, 0.1), delay=(3, 0)), moving(n=10))
    loop.run(0, 5)
    loop.alive[3:] = 0.0
    before = loop.y.copy()
    loop.run(5, 5)
    assert np.array_equal(loop.y[:, 3:], before[:, 3:])
    assert (loop.y[:, :3] != before[:, :3]).all()
