"""The loop of parts: whose rows are whose, and bits that depend on nothing but a slot's own parts."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT

from smo_gym import LQR, CartPendulum, Oracle, SlidingModeController, SlidingModeObserver
from smo_gym.actuators import limited
from smo_gym.kernels.blocks import XHAT, U, Y, at, block, put
from smo_gym.loop import Loop, Part, columns, side_by_side
from smo_gym.plant import moving
from smo_gym.sensors import exact

DT, FORCE, NOMINAL = 0.001, 30.0, CartPendulum()
OBSERVERS = (
    SlidingModeObserver(),
    SlidingModeObserver("smc", slopes=(9.0, 20.0), xhat0=(0.1, 0.0, 0.2, 0.0)),
    Oracle(),
    SlidingModeObserver(step=0.0005),
)
LAWS = (LQR([7.234, -4.132, 11.075, -1.025]), SlidingModeController((1.0, 2.0, 2.0, 1.0), 0.005, 5.0))


@block
def _measured(signals, own, lanes):
    for i in range(lanes):
        put(signals, XHAT, i, at(signals, Y, i))
        put(own, 0, i, at(own, 0, i) + 1.0)


def counting(n):
    """An observer of another make: one row of its own, and [y, 0, 0] at first."""
    return Part(columns(n, 0.0), sample=_measured)


def cases(slots):
    """Plants and starts that depend on the slot alone."""
    draws = [np.random.default_rng(slot) for slot in slots]
    return (
        np.array([NOMINAL.draw(0.2, rng).as_array() for rng in draws]).T.copy(),
        np.array([rng.uniform(-1.0, 1.0, 4) for rng in draws]).T.copy(),
    )


def watched(slots, observer, law, substeps=5, **more):
    """A loop of some slots, started."""
    params, x = cases(slots)
    n = len(slots)
    parts = {"actuator": limited(n, FORCE), "plant": moving(params, DT), "sensor": exact(n), "observer": observer}
    loop = Loop(n, substeps, {**parts, "law": law, **more})
    loop.start(slice(None), x)
    return loop


def usual(n, first=0, kind=0, law=0):
    return watched(range(first, first + n), OBSERVERS[kind].part(n, DT, FORCE, NOMINAL), LAWS[law].part(n))


def shown(loop):
    """All that a loop has to show, bit by bit."""
    return loop.rows.tobytes()


def signals(loop):
    return np.vstack([loop.x, loop.y, loop.u, loop.xhat, loop.alive, loop.failed])


@pytest.mark.parametrize("law", [0, 1])
@pytest.mark.parametrize("n", range(1, 71))
def test_a_slot_has_the_same_bits_in_a_loop_of_any_size(n, law, largest):
    loop = usual(n, law=law)
    loop.run(periods=4)
    assert np.array_equal(loop.rows, largest[law][:, :n])


@pytest.fixture(scope="module")
def largest():
    loops = [usual(200, law=law) for law in (0, 1)]
    for loop in loops:
        loop.run(periods=4)
    return [loop.rows for loop in loops]


def test_slots_of_mixed_parts_have_the_bits_of_a_loop_of_their_kind():
    kinds = [0, 1, 1, 2, 3, 3, 0, 0, 2, 1, 3] * 7
    each = [OBSERVERS[kind].part(1, DT, FORCE, NOMINAL) for kind in kinds]
    laws = [LAWS[i % 2].part(1) for i in range(len(kinds))]
    mixed = watched(range(len(kinds)), side_by_side(each), laws)
    mixed.run(periods=30)
    for slot, kind in enumerate(kinds):
        alone = usual(1, slot, kind, slot % 2)
        alone.run(periods=30)
        assert np.array_equal(signals(alone)[:, 0], signals(mixed)[:, slot]), slot


def test_parts_of_equal_kind_become_one():
    a, b = (OBSERVERS[0].part(n, DT, FORCE, NOMINAL) for n in (2, 3))
    finer, truth = OBSERVERS[3].part(1, DT, FORCE, NOMINAL), OBSERVERS[2].part(4, DT, FORCE, NOMINAL)
    parts = side_by_side([a, b, finer, truth, truth])
    assert [part.rows.shape[1] for part in parts] == [5, 1, 8]
    assert np.array_equal(parts[0].rows, np.hstack([a.rows, b.rows]))
    assert np.array_equal(parts[0].xhat, np.hstack([a.xhat, b.xhat]))


def test_shorter_parts_beside_longer_ones_keep_to_their_rows():
    long, short = OBSERVERS[0].part(3, DT, FORCE, NOMINAL), counting(4)
    loop = watched(range(7), [long, short], LAWS[0].part(7))
    _, x = cases(range(7))
    assert np.array_equal(loop.xhat[:, 3:], np.vstack([x[:2, 3:], np.zeros((2, 4))]))
    assert (loop.xhat[:, :3] == 0.0).all()
    loop.run(periods=2)
    assert (loop.own("observer")[0, 3:] == 10.0).all()
    assert (loop.own("observer")[1:, 3:] == 0.0).all()
    loop.restart("observer", np.arange(7) == 5)
    assert loop.own("observer")[0, 3:].tolist() == [10.0, 10.0, 0.0, 10.0]
    assert loop.xhat[:, 5].tolist() == [*loop.y[:, 5], 0.0, 0.0]


def test_parts_are_called_in_one_order_however_they_are_given():
    params, x = cases(range(9))
    parts = {
        "observer": OBSERVERS[0].part(9, DT, FORCE, NOMINAL),
        "later": Part(columns(9, 0.0), close=_measured),
        "law": LAWS[1].part(9),
        "sensor": exact(9),
        "earlier": Part(columns(9, 0.0), close=_measured),
        "plant": moving(params, DT),
        "actuator": limited(9, FORCE),
    }
    found = []
    for names in (list(parts), sorted(parts), sorted(parts, reverse=True)):
        loop = Loop(9, 5, {name: parts[name] for name in names})
        loop.start(slice(None), x)
        loop.run(periods=10)
        found.append((list(loop.parts), shown(loop)))
    assert found[0] == found[1] == found[2]
    assert found[0][0] == ["law", "actuator", "plant", "sensor", "observer", "earlier", "later"]


def test_a_part_that_serves_another_number_of_slots_is_named():
    with pytest.raises(ValueError, match="the loop's sensor serves 4 slots, it must serve 5"):
        Loop(5, 1, {"sensor": exact(4)})
    with pytest.raises(ValueError, match="the loop's law serves 3 slots, it must serve 5"):
        Loop(5, 1, {"sensor": exact(5), "law": [LAWS[0].part(1), LAWS[1].part(2)]})
    with pytest.raises(ValueError, match="the loop's observer serves 6 slots, it must serve 5"):
        usual(5).with_parts(observer=counting(6))


@pytest.mark.parametrize("copied", [lambda loop: pickle.loads(pickle.dumps(loop)), copy.deepcopy])
def test_a_copy_goes_on_where_it_was_and_alone(copied):
    loop = usual(70)
    loop.run(periods=3)
    twin, before = copied(loop), shown(loop)
    assert shown(twin) == before
    twin.u[:] = 1.0
    assert (twin.rows[U] == 1.0).all()
    assert shown(loop) == before
    twin = copied(loop)
    loop.run(3, 5)
    twin.run(3, 5)
    assert shown(twin) == shown(loop)
    loop.start(slice(None), cases(range(70))[1])
    twin.start(slice(None), cases(range(70))[1])
    assert shown(twin) == shown(loop)


def test_more_parts_leave_what_was_there():
    loop = usual(5)
    loop.run(periods=3)
    before = signals(loop), loop.own("plant").copy()
    more = loop.with_parts(observer=counting(5), metrics=Part(columns(5, 7.0)))
    assert np.array_equal(signals(more), before[0])
    assert np.array_equal(more.own("plant"), before[1])
    assert (more.own("metrics") == 7.0).all()


@pytest.mark.parametrize("law", [0, 1])
@pytest.mark.parametrize("chunk", [1, 3, 7])
def test_how_many_periods_a_call_drives_changes_no_bit(chunk, law):
    reference = np.random.default_rng(0).uniform(-0.1, 0.1, (5 * 50 + 1, 4))
    at_once, in_chunks = usual(70, law=law), usual(70, law=law)
    at_once.run(0, 50, reference)
    for k in range(0, 50, chunk):
        in_chunks.run(k, min(chunk, 50 - k), reference)
    assert shown(in_chunks) == shown(at_once)


@pytest.mark.parametrize("chunk", [1, 3, 7, 16])
def test_how_many_periods_a_call_drives_changes_nothing_that_ended_slots_show(chunk):
    x = cases(range(70))[1]
    x[:, :64] = 1e300  # the whole first block ends at once
    at_once, in_chunks = usual(70, kind=1), usual(70, kind=1)
    for loop in (at_once, in_chunks):
        loop.start(slice(None), x)
    at_once.run(0, 50)
    for k in range(0, 50, chunk):
        in_chunks.run(k, min(chunk, 50 - k))
    assert np.array_equal(signals(in_chunks), signals(at_once))
    assert at_once.failed[:64].all()
    assert (at_once.u[:64] == 0.0).all()


@pytest.mark.parametrize("n", [65, 270, 300])
def test_threads_change_no_bit(n, monkeypatch):
    monkeypatch.setattr("smo_gym.kernels.batch._WORTH_A_THREAD", 0.0)
    found = []
    for threads in (1, 2, 3):
        monkeypatch.setattr("smo_gym.kernels.batch._pool.threads", threads)
        loop = usual(n)
        loop.run(periods=5)
        found.append(shown(loop))
    assert found[0] == found[1] == found[2]


def test_slots_that_have_failed_hold_still_and_the_others_go_on():
    _, x = cases(range(70))
    x[:, 10:] = 1e300  # the state cannot be finite after a step
    loop = usual(70)
    loop.start(slice(None), x)
    loop.run(periods=40)
    alone = usual(10)
    alone.run(periods=40)
    assert loop.failed.tolist() == [0.0] * 10 + [1.0] * 60
    assert loop.alive.tolist() == [1.0] * 10 + [0.0] * 60
    assert (loop.x[:, 10:] == 1e300).all()
    assert np.array_equal(signals(loop)[:, :10], signals(alone))


def test_columns_are_rows_of_numbers_arrays_and_slots():
    found = columns(3, 1.0, [2.0, 3.0], np.array([[4.0, 5.0, 6.0]]))
    assert found.tolist() == [[1.0] * 3, [2.0] * 3, [3.0] * 3, [4.0, 5.0, 6.0]]


PROBE = """
import sys
sys.path.insert(0, "tests")
from test_loop import shown, usual
for law in (0, 1):
    for kind in (0, 2, 3):
        loop = usual(3, kind=kind, law=law)
        loop.run(periods=3)
        print(shown(loop).hex())
"""


@pytest.mark.slow
def test_without_a_compiler_the_bits_are_the_same():
    def probe(**environment):
        place = os.environ | {"PYTHONPATH": str(ROOT)} | environment
        command = [sys.executable, "-c", PROBE]
        return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, env=place).stdout

    compiled = probe()
    assert compiled.count("\n") == 6
    assert probe(NUMBA_DISABLE_JIT="1") == compiled


def test_arrays_of_another_shape_are_refused_before_compiled_code_reads_them():
    estimator = SlidingModeObserver().start(16, 0.001, 30.0, CartPendulum())
    with pytest.raises(ValueError, match=r"recording has shape \(5, 2, 1\), it must have shape \(5, 2, 16\)"):
        estimator.update(np.zeros((5, 2, 1)), np.zeros(16))
    loop = Loop(2, 3, {})
    with pytest.raises(ValueError, match=r"positions has shape \(2, 2, 2\), it must have shape \(3, 2, 2\)"):
        loop.run(positions=np.zeros((2, 2, 2)))
    with pytest.raises(ValueError, match="it must have 7 rows of 4"):
        loop.run(0, 2, reference=np.zeros((6, 4)))
