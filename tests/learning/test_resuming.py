"""Resuming a training run: to the same bit, and without opening what is no checkpoint."""

import json
import math
import os
import pickle

import numpy as np
import pytest
import torch

from smo_gym.evaluation import configs
from smo_gym.learning import measurement, settings, training


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Evaluations over a second."""
    measure = training.measure
    monkeypatch.setattr(training, "measure", lambda policy, stream=measurement.TEST: measure(policy, stream, 5, 1.0))


def small_run(algorithm="ppo", **change):
    """Three checkpoints, 32 steps each."""
    path = configs.path("ppo" if algorithm == "ppo" else "ppo_lstm")
    run = settings.load(path, "SMOPendulum-v0", algorithm, steps=96)
    small = {"n_steps": 4, "batch_size": 32, "n_epochs": 1, **change}
    return training.replace(run, n_envs=8, hyperparameters=run.hyperparameters | small).checked()


@pytest.mark.parametrize(
    ("algorithm", "change"),
    [
        ("recurrent", {}),
        ("ppo", {"use_sde": True}),
        ("ppo", {"use_sde": True, "sde_sample_freq": 2}),
        ("ppo", {"target_kl": 0.01, "n_epochs": 3}),
    ],
)
def test_what_follows_a_checkpoint_depends_on_it_alone(algorithm, change, tmp_path, monkeypatch):
    run = small_run(algorithm, **change)
    for name in ("whole", "run"):
        (tmp_path / name).mkdir()
    training.train(run, tmp_path / "whole")
    keep = training.Watch.keep

    def interrupt(watch):
        keep(watch)
        if watch.num_timesteps == 32:
            raise KeyboardInterrupt

    monkeypatch.setattr(training.Watch, "keep", interrupt)
    with pytest.raises(KeyboardInterrupt):
        training.train(run, tmp_path / "run")
    begun = learned(tmp_path / "run")
    monkeypatch.setattr(training.Watch, "keep", keep)
    training.train(run, tmp_path / "run")
    whole, resumed = learned(tmp_path / "whole"), learned(tmp_path / "run")
    assert whole["curve"] == resumed["curve"]
    assert all(torch.equal(tensor, resumed["policy"][name]) for name, tensor in whole["policy"].items())
    assert not all(torch.equal(tensor, begun["policy"][name]) for name, tensor in whole["policy"].items())


def learned(folder):
    return torch.load(folder / "checkpoint.pt", weights_only=True)


class _Evil:
    def __init__(self, to):
        self.to = to

    def __reduce__(self):
        return os.system, (f"touch {self.to}",)


def _missing_best(folder, state):
    (folder / "best.safetensors").unlink()


def _best_of_another_run(folder, state):
    card = json.loads((folder / "best.json").read_text())
    card["configuration"]["seed"] = 7
    (folder / "best.json").write_text(json.dumps(card))


def _deep(folder, state):
    (folder / "run.json").write_text("[" * 100_000)


def _pickle(folder, state):
    (folder / "checkpoint.pt").write_bytes(pickle.dumps(_Evil(folder / "ran"), protocol=4))


def _pickle_in_an_archive(folder, state):
    torch.save({"policy": _Evil(folder / "ran")}, folder / "checkpoint.pt")


def _link_to_a_pickle(folder, state):
    (folder / "other").write_bytes(pickle.dumps(_Evil(folder / "ran")))
    (folder / "checkpoint.pt").unlink()
    (folder / "checkpoint.pt").symlink_to(folder / "other")


def _no_list(folder, state):
    torch.save([1, 2], folder / "checkpoint.pt")


def _not_finite(folder, state):
    state["policy"]["action_net.weight"] *= math.nan


def _another_shape(folder, state):
    state["policy"]["action_net.weight"] = torch.zeros(3)


def _moments_of_another_shape(folder, state):
    state["optimizer"][0]["exp_avg"] = torch.zeros(3)


def _words_for_moments(folder, state):
    state["optimizer"][0]["exp_avg"] = "x"


def _no_curve(folder, state):
    state["curve"] = []


def _no_moments(folder, state):
    state["optimizer"] = {}


def _half_a_curve(folder, state):
    state["curve"] = [{"steps": 32}]


def _negative_steps(folder, state):
    state["curve"][-1]["steps"] = -5


def _words_for_updates(folder, state):
    state["n_updates"] = "many"


@pytest.mark.parametrize(
    "tamper",
    [
        _missing_best,
        _best_of_another_run,
        _deep,
        _pickle,
        _pickle_in_an_archive,
        _link_to_a_pickle,
        _no_list,
        _not_finite,
        _another_shape,
        _moments_of_another_shape,
        _words_for_moments,
        _no_moments,
        _no_curve,
        _half_a_curve,
        _negative_steps,
        _words_for_updates,
    ],
)
def test_a_checkpoint_that_something_was_done_to_is_one_line(tamper, tmp_path, recwarn):
    run = training.replace(small_run(), steps=32)
    training.train(run, tmp_path)
    checkpoint = tmp_path / "checkpoint.pt"
    state, before = learned(tmp_path), checkpoint.read_bytes()
    tamper(tmp_path, state)
    if checkpoint.read_bytes() == before:
        torch.save(state, checkpoint)
    with pytest.raises(ValueError, match="to begin anew") as caught:
        training.train(run, tmp_path)
    (line,) = str(caught.value).splitlines()
    assert len(line) < 800
    assert not recwarn.list  # it would be another line
    assert not (tmp_path / "ran").exists()


def test_numpy_integers_are_integers(tmp_path):
    run = small_run(batch_size=np.int16(32), n_steps=np.int64(4))
    run = training.replace(run, seed=np.int64(1), steps=np.int32(32), n_envs=np.uint8(8)).checked()
    card = training.train(run, tmp_path).card
    assert (card.seed, card.configuration["steps"]) == (1, 32)
    assert type(card.seed) is type(card.configuration["hyperparameters"]["n_steps"]) is int
