"""Actuators: each flaw against its definition, and all of them in order against NumPy."""

import copy
import math
import pickle

import numpy as np
import pytest

from smo_gym.actuators import ASKED, REFUSED, Actuator, force_sensor, limited
from smo_gym.kernels.blocks import FORCE, XHAT, U, at, block, put
from smo_gym.loop import Loop, Part

DT, LIMIT = 0.001, 30.0
SETTINGS = {
    "resolution": 0.7,
    "delay": 7,
    "dead_zone": 0.4,
    "rate_limit": 3000.0,
    "time_constant": 0.004,
}


@block
def _listen(signals, own, lanes):
    for i in range(lanes):
        put(signals, XHAT, i, at(signals, U, i))


def loop_of(actuator, n, substeps, limit=LIMIT):
    """Slots in which the actuator is heard alone; xhat is the force that an observer is told."""
    parts = {"actuator": actuator.part(n, limit, DT), "observer": Part(np.empty((0, n)), sample=_listen)}
    if actuator.measured:
        parts["force sensor"] = force_sensor(n)
    return Loop(n, substeps, parts)


def reached(actuator, wanted, substeps=5):
    """The row FORCE of each sampling period (samples, n) for forces wanted (periods, n)."""
    loop = loop_of(actuator, wanted.shape[1], substeps)
    found = []
    for k, force in enumerate(wanted):
        loop.u[:] = force
        readings = np.empty((substeps, 6, loop.n))
        loop.run(k, readings=readings)
        found.append(readings[:, 2])
    return np.concatenate(found)


def in_numpy(actuator, wanted, substeps):
    """The same from the definitions, one after the other over the whole episode."""
    u = np.repeat(np.clip(wanted, -LIMIT, LIMIT), substeps, axis=0)
    if actuator.resolution:
        most = math.floor(LIMIT / actuator.resolution)
        u = actuator.resolution * np.clip(np.round(u / actuator.resolution), -most, most)
    u = np.concatenate([np.zeros((actuator.delay, u.shape[1])), u])[: len(u)]
    u = np.where(np.abs(u) > actuator.dead_zone, u - np.sign(u) * actuator.dead_zone, 0.0)
    if actuator.rate_limit:
        for k in range(len(u)):
            before = u[k - 1] if k else 0.0
            u[k] = before + np.clip(u[k] - before, -actuator.rate_limit * DT, actuator.rate_limit * DT)
    if actuator.time_constant:
        r, f = DT / actuator.time_constant, np.zeros(u.shape[1])
        for k in range(len(u)):
            u[k], f = u[k] + (f - u[k]) * (1.0 - math.exp(-r)) / r, u[k] + (f - u[k]) * math.exp(-r)
    return u


def wishes(periods, n, seed=0):
    """Forces of which some are beyond the limit; those of a slot do not depend on n."""
    return np.array([np.random.default_rng([seed, slot]).uniform(-40.0, 40.0, periods) for slot in range(n)]).T


def test_an_ideal_one_lets_through_what_is_asked_for():
    wanted = wishes(20, 9)
    assert [each.ideal for each in (Actuator(), Actuator(unit=2.0), Actuator(measured=True))] == [True, True, False]
    assert np.array_equal(reached(Actuator(), wanted, 3), np.repeat(np.clip(wanted, -LIMIT, LIMIT), 3, axis=0))


@pytest.mark.parametrize("time_constant", [0.02, 1e-5, 50.0])
def test_the_lag_is_exponential_and_the_cart_feels_its_mean(time_constant):
    found = reached(Actuator(time_constant=time_constant), np.full((30, 1), 10.0), 4)[:, 0]
    t = DT * np.arange(121)
    integral = t - time_constant * -np.expm1(-t / time_constant)  # of 1 - exp(-t / T)
    np.testing.assert_allclose(np.cumsum(found) * DT, 10.0 * integral[1:], rtol=1e-9)
    np.testing.assert_allclose(found, 10.0 * np.diff(integral) / DT, rtol=1e-6)


@pytest.mark.parametrize("delay", [1, 2, 5, 6, 13])
def test_a_delay_is_to_the_sample_also_across_control_periods(delay):
    sent = np.repeat(np.clip(wanted := wishes(12, 3), -LIMIT, LIMIT), 5, axis=0)
    found = reached(Actuator(delay=delay), wanted, 5)
    assert not found[:delay].any()
    assert np.array_equal(found[delay:], sent[:-delay])


def test_the_force_climbs_no_faster_than_its_limit_and_then_is_what_was_asked_for():
    found = reached(Actuator(rate_limit=2000.0), np.array([[9.0], [9.0], [-30.1]]), 4)[:, 0]
    np.testing.assert_allclose(found, [2, 4, 6, 8, 9, 9, 9, 9, 7, 5, 3, 1], rtol=1e-14)
    assert found[4] == 9.0


def test_a_dead_zone_takes_its_width():
    found = reached(Actuator(dead_zone=0.5), np.array([[0.4, -0.5, 0.75, -3.0, 40.0]]), 1)[0]
    assert found.tolist() == [0.0, 0.0, 0.25, -2.5, 29.5]


def test_a_converter_has_steps():
    found = reached(Actuator(resolution=0.25), wanted := wishes(1, 50), 1)[0]
    assert np.array_equal(4.0 * found, np.rint(4.0 * found))
    assert np.abs(found - np.clip(wanted[0], -LIMIT, LIMIT)).max() <= 0.125


def test_no_step_of_a_converter_is_beyond_the_limit():
    wanted = np.array([[30.0, -40.0, 27.9, 3.6]])
    assert reached(Actuator(resolution=8.0), wanted, 1)[0].tolist() == [24.0, -24.0, 24.0, 0.0]
    loop = loop_of(Actuator(resolution=8.0), 1, 1, math.inf)
    loop.u[:] = 30.0
    loop.run()
    assert loop.rows[FORCE].item() == 32.0


@pytest.mark.parametrize("seed", range(40))
def test_the_order_is_the_documented_one(seed):
    rng = np.random.default_rng(seed)
    chosen = {name: value for name, value in SETTINGS.items() if rng.random() < 0.6}
    for name in chosen:
        chosen[name] = int(rng.integers(1, 12)) if name == "delay" else chosen[name] * rng.uniform(0.5, 2.0)
    actuator, substeps, wanted = Actuator(**chosen), int(rng.integers(1, 7)), wishes(25, 6, seed)
    np.testing.assert_allclose(reached(actuator, wanted, substeps), in_numpy(actuator, wanted, substeps), atol=1e-11)


@pytest.mark.parametrize("measured", [False, True])
def test_an_observer_is_told_what_comes_only_where_it_is_measured(measured):
    loop = loop_of(Actuator(time_constant=0.01, measured=measured), 4, 5)
    loop.u[:] = [1.0, -2.0, 50.0, 0.0]
    loop.run()
    asked = [1.0, -2.0, LIMIT, 0.0]
    assert loop.u.tolist() == loop.own("actuator")[ASKED].tolist() == asked
    assert loop.xhat[0].tolist() == (loop.rows[FORCE].tolist() if measured else asked)
    assert 0.0 < loop.rows[FORCE, 0] < 0.5


@pytest.mark.parametrize("wanted", [math.nan, math.inf, -math.inf])
def test_a_force_that_is_not_finite_is_refused_as_ever(wanted):
    for part in (limited(3, LIMIT), Actuator(time_constant=0.01).part(3, LIMIT, DT)):
        loop = Loop(3, 2, {"actuator": part})
        loop.u[:] = [1.0, wanted, 2.0]
        loop.run()
        assert loop.u.tolist() == [1.0, 0.0, 2.0]
        assert loop.failed.tolist() == [0.0, 1.0, 0.0]
        assert np.array_equal(loop.own("actuator")[REFUSED], [0.0, wanted, 0.0], equal_nan=True)


def test_a_run_that_has_ended_has_no_force_and_begins_anew_without_a_memory():
    actuator = Actuator(**SETTINGS)
    loop, fresh = loop_of(actuator, 2, 5), loop_of(actuator, 2, 5)
    loop.u[:] = 20.0
    loop.run(periods=3)
    loop.alive[1] = 0.0
    loop.u[:] = 20.0
    loop.run(3)
    assert loop.rows[FORCE, 0] > 0.0
    assert loop.rows[FORCE, 1] == loop.u[1] == 0.0
    for each, slots in ((loop, [False, True]), (fresh, [True, True])):
        each.start(np.array(slots), np.zeros((4, sum(slots))))
        each.u[:] = 10.0
        each.run(periods=2)
    assert np.array_equal(loop.rows[:, 1], fresh.rows[:, 1])


def test_a_slot_has_the_same_bits_in_any_batch():
    actuator, wanted = Actuator(**SETTINGS), wishes(12, 130)
    all_of_them = reached(actuator, wanted)
    for n in (1, 5, 64):
        assert np.array_equal(reached(actuator, wanted[:, :n]), all_of_them[:, :n])


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_copies_go_on_alike(copied):
    actuator = Actuator(measured=True, **SETTINGS)
    assert copied(actuator) == actuator
    loop = loop_of(actuator, 3, 5)
    loop.u[:] = 5.0
    loop.run(periods=2)
    again = copied(loop)
    for each in (loop, again):
        each.run(2, 3)
    assert np.array_equal(loop.rows, again.rows)


def test_it_is_made_of_what_a_file_holds():
    assert Actuator.of(None) == Actuator.of({}) == Actuator()
    assert Actuator.of({"delay": 3, "rate_limit": 5}) == Actuator(delay=3, rate_limit=5.0)
    assert Actuator.of(actuator := Actuator(unit=2.5)) is actuator


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"time_constant": -0.1}, r"actuator time_constant=-0\.1 must be at least 0"),
        ({"dead_zone": -1.0}, r"actuator dead_zone=-1\.0 must be at least 0"),
        ({"back_emf": math.nan}, r"actuator back_emf=nan must be a finite number"),
        ({"unit": 0.0}, r"actuator unit=0\.0 must be a finite number greater than 0"),
        ({"resolution": 0.0}, r"actuator resolution=0\.0 must be at least 1e-12, or None for none"),
        ({"rate_limit": 0}, r"actuator rate_limit=0 must be greater than 0, or None for none"),
        ({"rate_limit": "fast"}, r"actuator rate_limit='fast' must be a finite number"),
        ({"delay": 1.5}, r"actuator delay=1\.5 must be a whole number of at least 0"),
        ({"measured": 1}, r"actuator measured=1 must be True or False"),
        ({"time_constnt": 1.0}, r"unknown actuator setting 'time_constnt': did you mean 'time_constant'\?"),
        (3.0, r"actuator setting: 3\.0 must be a mapping"),
        ([], r"actuator setting: \[\] must be a mapping"),
    ],
)
def test_what_is_not_allowed_is_named(settings, words):
    with pytest.raises(ValueError, match=words):
        Actuator.of(settings)


def test_a_delay_ends_before_the_episode():
    Actuator(delay=99).check(0.001, 0.1)
    with pytest.raises(ValueError, match=r"delay=100 samples of dt=0\.001 s must be less than the horizon=0\.1 s"):
        Actuator(delay=100).check(0.001, 0.1)
