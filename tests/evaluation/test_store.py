"""A study that was stopped goes on with what is left, to the same bits; nothing that is kept is taken for another."""

import builtins
import os
import pickle
import random
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from smo_gym import files
from smo_gym.evaluation import scenario, store, study
from smo_gym.evaluation.pieces import SLOTS, cut
from smo_gym.policies import named

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def place(name="initial-conditions", seconds=0.2, agents=()):
    found = scenario.load(CONFIGS / f"{name}.yaml")
    found = found.model_copy(update={"horizon": scenario.Setting[float](value=seconds, source="chosen")})
    for agent in agents:
        found = found.with_agent(str(agent))
    return found


@pytest.fixture(scope="module")
def groups():
    return study.groups([place()], ["lqr", "smc"], ["without", "with", "theorem", "oracle"], 90)


@pytest.fixture(scope="module")
def whole(groups):
    return study.measure(groups, seed=3, samples=10)


def bits(outcomes):
    """All numbers of outcomes, their order and layout in memory."""
    return [
        (name, array.dtype.str, array.shape, array.flags.c_contiguous, array.tobytes())
        for outcome in outcomes
        for name, array in [
            *outcome.metrics.items(),
            ("failed", outcome.failed),
            ("plants", outcome.plants),
            *((name, getattr(outcome.traces, name)) for name in study.Traces.__slots__ if outcome.traces is not None),
        ]
        if array is not None
    ]


def stamps(folder):
    """Which file is which: a file that is written again has another number or time."""
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.iterdir()}


class Counted:
    """A map like the builtin that lists which groups are run."""

    def __init__(self, stop=None):
        self.run, self.stop = [], stop

    def __call__(self, function, pieces):
        for piece in pieces:
            if self.stop is not None and len(self.run) >= self.stop:
                raise KeyboardInterrupt
            self.run += piece.indices
            yield function(piece)


def test_pieces_have_some_hundred_slots_of_one_kind():
    slots = [1, 500, 500, 100, 100, 100, 1]
    pieces = cut(["a", "a", "b", "a", "a", "b", "a"], slots)
    assert pieces == [[0, 1], [2], [3, 4, 6], [5]]
    assert all(sum(slots[i] for i in piece[:-1]) < SLOTS for piece in pieces)
    assert cut([], []) == []


def test_neither_pieces_nor_their_order_change_a_bit(groups, whole, monkeypatch):
    def shuffled(function, pieces):
        pieces = [*pieces]
        random.Random(0).shuffle(pieces)
        return map(function, pickle.loads(pickle.dumps(pieces)))

    assert bits(study.measure(groups, 3, samples=10, map=shuffled)) == bits(whole)
    monkeypatch.setattr("smo_gym.evaluation.pieces.SLOTS", 1)
    assert bits(study.measure(groups, 3, samples=10)) == bits(whole)


def test_a_study_that_was_stopped_goes_on_with_the_rest(groups, whole, tmp_path):
    ran = []
    for stop in (1, 20, 40):
        counted = Counted(stop - len(ran))
        with pytest.raises(KeyboardInterrupt):
            study.measure(groups, 3, samples=10, map=counted, store=store.Store(tmp_path))
        ran += counted.run
        assert len([*tmp_path.iterdir()]) == len(ran)
    before, last, seconds = stamps(tmp_path), Counted(), []
    outcomes = study.measure(groups, 3, seconds.append, samples=10, map=last, store=store.Store(tmp_path))
    assert bits(outcomes) == bits(whole)
    assert [outcome.group for outcome in outcomes] == groups
    assert sorted(ran + last.run) == [*range(len(groups))]
    assert before.items() <= stamps(tmp_path).items()
    assert sum(seconds) == pytest.approx(study.simulated_seconds(groups))
    again = Counted()
    assert bits(study.measure(groups, 3, samples=10, map=again, store=store.Store(tmp_path))) == bits(whole)
    assert not again.run


@pytest.mark.parametrize(
    "damage",
    [
        lambda data, other: b"",
        lambda data, other: data[: len(data) // 2],
        lambda data, other: data[:-3] + bytes([data[-3] ^ 1]) + data[-2:],
        lambda data, other: other,
        lambda data, other: pickle.dumps({"mse_h": 0.0}),
    ],
    ids=["empty", "cut", "a bit", "another group's", "foreign"],
)
def test_what_is_damaged_is_run_again_and_replaced(groups, whole, tmp_path, damage):
    groups, whole = groups[:4], whole[:4]
    kept = store.Store(tmp_path)
    study.measure(groups, 3, samples=10, store=kept)
    paths = [tmp_path / f"{kept.key(group, 3, 10)}{store.SUFFIX}" for group in groups]
    data = paths[2].read_bytes()
    paths[2].write_bytes(damage(data, paths[1].read_bytes()))
    counted = Counted()
    assert bits(study.measure(groups, 3, samples=10, map=counted, store=kept)) == bits(whole)
    assert counted.run == [2]
    assert paths[2].read_bytes() == data


def test_whatever_a_group_depends_on_changes_its_key(tmp_path, monkeypatch):
    kept = store.Store(tmp_path)
    group = study.groups([place()], ["lqr"], ["with"], 2)[-1]
    shorter, other = place(seconds=0.1), place("regulation")
    keys = [
        kept.key(group, 0, None),
        kept.key(group, 1, None),
        kept.key(group, 0, 10),
        *(
            kept.key(replace(group, **change), 0, None)
            for change in (
                {"runs": 3},
                {"arm": "oracle"},
                {"case": "1"},
                {"uncertainty": 0.25},
                {"controller": "smc"},
                {"scenario": shorter},
                {"scenario": other, "case": next(iter(other.initial_states.value))},
            )
        ),
    ]
    monkeypatch.setattr(store, "code", lambda: {"numpy": "0"})
    keys.append(kept.key(group, 0, None))
    assert len({*keys}) == len(keys)
    assert None not in keys
    own = {"value": dict.fromkeys(group.scenario.initial_states.value, (0.1, 0.2, 0.3, 0.4)), "source": "chosen"}
    elsewhere = group.scenario.changed(controllers={"lqr": {**dict(group.settings), "initial_states": own}})
    assert kept.key(replace(group, scenario=elsewhere), 0, None) not in keys
    # the other controllers of its scenario are not among it
    monkeypatch.undo()
    alone = group.scenario.model_copy(update={"controllers": {"lqr": group.settings}})
    assert kept.key(replace(group, scenario=alone), 0, None) == keys[0]


def test_the_sources_of_this_package_are_in_the_key():
    code = store.code()
    assert len(code["smo_gym"]) == 64
    assert code["numpy"] == np.__version__
    assert {path.suffix for path in store.PACKAGE.glob("policies/baselines/*")} == {".json", ".safetensors"}


def test_the_files_of_a_policy_are_in_its_key(tmp_path):
    path = tmp_path / "policy.safetensors"
    named.shipped("SMOPendulum-v0").save(path)
    (group,) = study.groups([place("regulation", agents=[path])], [str(path)], ["with"], 1)[:1]
    kept = store.Store(tmp_path / "kept")
    kept.folder.mkdir()
    key = kept.key(group, 0, None)
    card = path.with_suffix(".json")
    card.write_text(card.read_text() + "\n")
    assert kept.key(group, 0, None) not in (None, key)

    def changed_meanwhile(function, pieces):
        for piece in pieces:
            found = function(piece)
            card.write_text(card.read_text() + "\n")
            yield found

    study.measure([group], 0, map=changed_meanwhile, store=kept)
    assert not [*kept.folder.iterdir()]
    study.measure([group], 0, store=kept)
    assert len([*kept.folder.iterdir()]) == 1
    path.unlink()
    assert kept.key(group, 0, None) is None


def test_the_code_of_others_is_not_kept(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text("from smo_gym import LQR\n\ndef Mine():\n    return LQR([0.0, 0.0, 0.0, 0.0])\n")
    monkeypatch.syspath_prepend(tmp_path)
    kept = store.Store(tmp_path)
    (group,) = study.groups([place(agents=["mine:Mine"])], ["mine:Mine"], ["with"], 1)[:1]
    assert kept.key(group, 0, None) is None
    study.measure([group], 0, store=kept)
    assert not [*tmp_path.glob(f"*{store.SUFFIX}")]
    lqr = replace(group, controller="lqr")
    assert kept.key(lqr, 0, None) is not None
    gymnasium.register("Mine-v0", entry_point="mine:Env", vector_entry_point="mine:VectorEnv")
    try:
        own = group.scenario.model_copy(update={"environment": "Mine-v0"})
        assert kept.key(replace(lqr, scenario=own), 0, None) is None
    finally:
        del gymnasium.registry["Mine-v0"]


def test_a_store_goes_with_its_end_and_leaves_what_is_not_its_own(groups, tmp_path):
    with pytest.raises(KeyboardInterrupt), store.kept(tmp_path) as kept:
        study.measure(groups, 0, map=Counted(2), store=kept)
    assert [*(tmp_path / store.FOLDER).iterdir()]
    (tmp_path / store.FOLDER / ".smo_gym-killed").write_text("half")
    with store.kept(tmp_path) as kept:
        study.measure(groups[:3], 0, store=kept)
    assert not [*tmp_path.iterdir()]
    with store.kept(tmp_path) as kept:
        (kept.folder / "mine.txt").write_text("mine")
        study.measure(groups[:3], 0, store=kept)
    assert [path.name for path in (tmp_path / store.FOLDER).iterdir()] == ["mine.txt"]


def test_a_full_disk_stops_no_study(groups, whole, tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(files.os, "fsync", full)
    with store.kept(tmp_path) as kept:
        assert bits(study.measure(groups[:3], 3, samples=10, store=kept)) == bits(whole[:3])
        assert not [*kept.folder.iterdir()]


def test_here_it_is_told_what_a_piece_has_done_before_it_is_done(groups, monkeypatch):
    monkeypatch.setattr("smo_gym.evaluation.drivers._SLOT_STEPS", 50)
    told = {}
    for mapped in (builtins.map, Counted()):
        told[mapped] = []
        study.measure(groups[:1], 0, told[mapped].append, map=mapped)
    here, elsewhere = told.values()
    assert len(here) > len(elsewhere) == 2
    assert sum(here) == pytest.approx(sum(elsewhere))
