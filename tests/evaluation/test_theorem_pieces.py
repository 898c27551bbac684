"""The theorem's runs in pieces: the same bits, and what is kept is not run again."""

from dataclasses import fields

import numpy as np
import pytest
from conftest import assert_same

from smo_gym import CartPendulum
from smo_gym.evaluation import scenario, theorem_pieces
from smo_gym.evaluation.configs import path
from smo_gym.evaluation.store import Store
from smo_gym.evaluation.theorem_on_runs import converge


@pytest.fixture(scope="module")
def asked():
    settings = scenario.load_theorem(path("theorem"))
    over = settings.over(CartPendulum())
    article = scenario.named("initial-conditions")
    observers = {"designed": settings.build(0.001, over.model)}
    observers["printed"] = article.controllers["lqr"].observer.build(True)
    rng = np.random.default_rng(0)
    starts = rng.uniform(*np.array(settings.starts.value), (5, 4))
    plants = np.array([CartPendulum().draw(over.uncertainty, rng).as_array() for _ in range(5)])
    times = {"force": settings.force.value, "horizon": 0.2, "settle": 0.1}
    return (observers, article.agent("lqr"), over, starts, plants), times


def assert_equal(a, b):
    for name in [field.name for field in fields(a) if field.name != "squares"]:
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True), name
    assert_same(a.squares, b.squares)
    assert_same(a.velocity_rms, b.velocity_rms)


def test_pieces_are_what_all_runs_at_once_are(asked, monkeypatch):
    what, times = asked
    monkeypatch.setattr(theorem_pieces, "RUNS", 2)
    told = []
    found = theorem_pieces.converge_in_pieces(*what, **times, store=None, progress=told.append)
    assert_equal(found, converge(*what, **times))
    assert told == [2, 2, 1]


def test_what_is_kept_is_not_run_again(asked, monkeypatch, tmp_path):
    what, times = asked
    monkeypatch.setattr(theorem_pieces, "RUNS", 2)
    store, ran = Store(tmp_path), []

    def counted(*args, **settings):
        if len(ran) == 2:
            raise KeyboardInterrupt
        ran.append(len(args[3]))
        return converge(*args, **settings)

    monkeypatch.setattr(theorem_pieces, "converge", counted)
    with pytest.raises(KeyboardInterrupt):
        theorem_pieces.converge_in_pieces(*what, **times, store=store)
    assert len(list(tmp_path.glob("*.group"))) == 2
    ran.clear()
    found = theorem_pieces.converge_in_pieces(*what, **times, store=store)
    assert ran == [1]
    assert_equal(found, converge(*what, **times))
    monkeypatch.setattr(theorem_pieces, "converge", lambda *args, **settings: pytest.fail("kept for another question"))
    with pytest.raises(pytest.fail.Exception):
        theorem_pieces.converge_in_pieces(*what, **(times | {"settle": 0.15}), store=store)
