"""Disturbances: each kind against its formula, noise against its statistics, and functions of one's own."""

import copy
import math
import pickle

import numba
import numpy as np
import pytest
from scipy import stats

from smo_gym import disturbances
from smo_gym.disturbances import Disturbance
from smo_gym.kernels import COMPILES, pushing
from smo_gym.kernels.blocks import PUSH, block, four, put_four
from smo_gym.kernels.blocks import X as STATE
from smo_gym.kernels.noise import uniforms
from smo_gym.kernels.pushing import FIRST, GROUP, REFUSED
from smo_gym.loop import Loop, Part

DT = 0.001
SIGMAS = 5.0
MIXED = Disturbance.of(
    [
        {"kind": "noise", "force": 0.5, "torque": (0.01, 0.02), "bandwidth": 7.0},
        {"kind": "sine", "force": (1.0, 2.0), "frequency": (0.5, 3.0), "phase": (-3.0, 3.0), "start": (0.0, 0.01)},
        {"kind": "pulses", "torque": 0.1, "frequency": 40.0, "width": 0.01},
        {"kind": "noise", "force": 0.2, "start": 0.02},
    ]
)


@block
def _coast(signals, own, lanes):
    for i in range(lanes):
        h, theta, v, omega = four(signals, STATE, i)
        put_four(signals, STATE, i, (h + 0.001 * v, theta + 0.001 * omega, v, omega))


def loop_of(what, n, substeps=1, keys=None):
    """Slots that coast from states of their own and are pushed; keys are 0, 1, ... where none are given."""
    part = disturbances.part(what, n, DT)
    loop = Loop(n, substeps, {"disturbance": part, "plant": Part(np.empty((0, n)), sample=_coast)})
    disturbances.begin(loop.own("disturbance"), slice(None), what, np.arange(n) if keys is None else keys)
    loop.begin(slice(None), np.arange(4.0 * n).reshape(n, 4).T)
    return loop


def pushes(what, n=1, samples=100, keys=None, substeps=1):
    """The rows PUSH of each sampling period, (samples, 2, n)."""
    loop = loop_of(what, n, substeps, keys)
    found = []
    for k in range(samples // substeps):
        readings = np.empty((substeps, 6, n))
        loop.run(k, readings=readings)
        found.append(readings[:, 3:5].copy())
    assert not loop.failed.any()
    return np.concatenate(found)


def middles(samples):
    return DT * (np.arange(samples) + 0.5)


def formula(kind, t, start=0.0, frequency=1.0, phase=0.0, width=0.1):
    """w(t) from the docstring."""
    wave = {
        "constant": np.ones_like(t),
        "step": np.ones_like(t),
        "sine": np.sin(2.0 * np.pi * frequency * (t - start) + phase),
        "pulses": np.where(np.mod(t - start, 1.0 / frequency) < width, 1.0, 0.0),
    }[kind]
    return np.where(t >= start, wave, 0.0)


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("constant", {}),
        ("step", {"start": 0.25}),
        ("step", {"start": 0.0}),
        ("sine", {"start": 0.1, "frequency": 3.7, "phase": 0.4}),
        ("sine", {"frequency": 120.0}),
        ("pulses", {"start": 0.05, "frequency": 8.3, "width": 0.031}),
        ("pulses", {"frequency": 250.0, "width": 0.002}),
        ("pulses", {"frequency": 2.0, "width": 0.5}),
    ],
)
def test_each_kind_is_its_formula(kind, settings):
    found = pushes((Disturbance(kind, force=2.0, torque=-0.3, **settings),), 3, 1000)
    wave = formula(kind, middles(1000), **settings)
    np.testing.assert_allclose(found, np.multiply.outer(wave, [2.0, -0.3])[..., None].repeat(3, 2), rtol=0, atol=1e-12)


def test_a_sequence_adds_up():
    several = Disturbance.of(
        [{"force": 1.0}, {"kind": "sine", "force": 0.3, "torque": 0.1}, {"kind": "step", "torque": 2.0, "start": 0.03}]
    )
    alone = [pushes((each,), 4, 60) for each in several]
    np.testing.assert_allclose(pushes(several, 4, 60), sum(alone), atol=1e-15)


def test_noise_is_gauss_markov_and_stationary_from_the_first_sample():
    n, bandwidth = 4000, 20.0
    found = pushes((Disturbance("noise", force=2.0, torque=0.05, bandwidth=bandwidth),), n, 60)
    w = found / np.array([2.0, 0.05])[:, None]
    for k in (0, 1, 30, 59):
        assert np.abs(w[k].mean(axis=1)).max() < SIGMAS / math.sqrt(n)
        assert np.abs(w[k].var(axis=1) - 1.0).max() < SIGMAS * math.sqrt(2.0 / n)
        assert stats.kstest(w[k, 0], "norm").pvalue > 1e-5
    for first in (0, 20):  # over episodes, so that it does not rest on being ergodic
        for lag in (1, 5, 20):
            expected = math.exp(-2.0 * math.pi * bandwidth * lag * DT)
            products = w[first] * w[first + lag]
            assert np.abs(products.mean(axis=1) - expected).max() < SIGMAS * math.sqrt(2.0 / n)


def uncorrelated(a, b):
    return abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) * math.sqrt(a.size) < SIGMAS


def test_noise_is_independent_of_all_other():
    white = {"kind": "noise", "bandwidth": 1e5}  # by the next sample all is forgotten
    loop = loop_of(Disturbance.of([{**white, "force": 1.0}, {**white, "torque": 1.0}]), 500)
    states = [FIRST + d * GROUP + pushing.STATE + channel for d in range(2) for channel in range(2)]
    seen = []
    for k in range(200):
        loop.run(k)
        seen.append(loop.own("disturbance")[states])
    w = np.array(seen)
    sensors = uniforms(np.arange(500), [64.0 * k for k in range(200)])
    for a in range(4):
        assert uncorrelated(w[:, a, 1:], w[:, a, :-1])  # of neighbouring keys
        assert uncorrelated(w[1:, a], w[:-1, a])
        assert uncorrelated(w[:, a], sensors)
        assert all(uncorrelated(w[:, a], w[:, b]) for b in range(a))


def test_sizes_are_drawn_uniformly_and_again_for_the_same_key():
    what = Disturbance.of({"kind": "step", "force": (-1.0, 3.0), "torque": (0.0, 0.1)})
    assert what[0].random
    found = pushes(what, 5000, 1)[0]
    assert stats.kstest(found[0], stats.uniform(-1.0, 4.0).cdf).pvalue > 1e-5
    assert stats.kstest(found[1], stats.uniform(0.0, 0.1).cdf).pvalue > 1e-5
    assert uncorrelated(found[0], found[1])
    keys = np.array([17, 4000, 17, 2**52 - 1])
    again = pushes(what, 4, 5, keys)
    assert np.array_equal(again[0, :, :2], found[:, [17, 4000]])
    assert np.array_equal(again[..., 0], again[..., 2])
    assert (again == again[0]).all()
    assert not any(each.random for each in Disturbance.of([{"force": 1.0}, {"kind": "sine", "force": 1.0}]))


def test_a_slot_has_the_same_bits_in_any_batch_and_however_it_is_cut():
    largest = pushes(MIXED, 130, 60)
    for n in (1, 5, 64):
        assert np.array_equal(pushes(MIXED, n, 60), largest[..., :n])
    assert np.array_equal(pushes(MIXED, 130, 60, substeps=6), largest)
    loop = loop_of(MIXED, 5)
    loop.run(periods=60)
    assert np.array_equal(loop.rows[PUSH : PUSH + 2], largest[-1, :, :5])


def test_a_run_that_has_ended_is_not_pushed_and_one_begins_anew():
    loop = loop_of(MIXED, 2)
    loop.run(periods=10)
    loop.alive[0] = 0.0
    loop.run()
    assert not loop.rows[PUSH : PUSH + 2, 0].any()
    assert loop.rows[PUSH : PUSH + 2, 1].all()
    slot = np.array([True, False])
    loop.start(slot, np.zeros((4, 1)))
    disturbances.begin(loop.own("disturbance"), slot, MIXED, np.array([9]))
    loop.run(periods=3)
    assert np.array_equal(loop.rows[PUSH : PUSH + 2, 0], pushes(MIXED, 1, 3, np.array([9]))[-1, :, 0])


def wind(t, h, theta, h_dot, theta_dot):
    """A push of one's own."""
    return -0.5 * h_dot * abs(h_dot) + 2.0 * t, 0.1 * theta * h + theta_dot


def beyond_two(t, h, theta, h_dot, theta_dot):
    """Not a number in slots that begin beyond h = 2, from 3 ms on."""
    return (math.nan if h > 2.0 and t > 0.003 else 1.0), 0


def test_a_function_is_that_of_python():
    loop = loop_of(Disturbance.of(wind), 70)
    for k in range(20):
        x = loop.x.copy()
        loop.run(k)
        expected = [wind((k + 0.5) * DT, *x[:, i]) for i in range(70)]
        np.testing.assert_allclose(loop.rows[PUSH : PUSH + 2].T, expected, rtol=1e-14)


def test_a_function_may_be_compiled_already_and_stand_beside_others():
    compiled = numba.njit(wind)
    assert Disturbance.of(compiled)[0].function is compiled
    both = pushes((*MIXED[1:3], *Disturbance.of(compiled)), 3, 20)
    np.testing.assert_allclose(both, pushes(MIXED[1:3], 3, 20) + pushes(Disturbance.of(wind), 3, 20), atol=1e-12)


def test_what_is_not_finite_fails_its_slot_alone():
    loop = loop_of(Disturbance.of(beyond_two), 3, 5)
    loop.run()
    assert loop.failed.tolist() == [0.0, 1.0, 1.0]
    np.testing.assert_allclose(loop.own("disturbance")[REFUSED], [0.0, 0.004, 0.004])
    assert loop.rows[PUSH].tolist() == [1.0, 0.0, 0.0]
    loop.run(1)
    assert loop.alive.tolist() == [1.0, 0.0, 0.0]
    np.testing.assert_allclose(loop.own("disturbance")[REFUSED], [0.0, 0.004, 0.004])


def test_a_sum_that_overflows_fails_too():
    loop = loop_of(Disturbance.of([{"force": 1.5e308}, {"kind": "step", "force": 1.5e308}]), 2)
    loop.run()
    assert loop.failed.all()
    assert loop.own("disturbance")[REFUSED].tolist() == [DT, DT]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
@pytest.mark.parametrize("function", [wind, numba.njit(wind)])
def test_copies_go_on_alike(copied, function):
    what = (*MIXED, *Disturbance.of(function))
    assert copied(what) == what
    loop = loop_of(what, 3)
    loop.run(periods=5)
    again = copied(loop)
    for each in (loop, again):
        each.run(5, 5)
    assert np.array_equal(loop.rows, again.rows)
    assert disturbances.part(copied(what), 3, DT).kind == disturbances.part(what, 3, DT).kind


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_a_loop_of_a_function_without_a_name_is_copied_too(copied):
    if copied is not copy.deepcopy and not COMPILES:
        pytest.skip("Python pickles no function without a name, Numba does")
    size = 3.0
    loop = loop_of(Disturbance.of(lambda t, h, theta, h_dot, theta_dot: (size * t, h)), 2)
    again = copied(loop)
    for each in (loop, again):
        each.run(periods=5)
    assert loop.rows[PUSH].all()
    assert np.array_equal(loop.rows, again.rows)
