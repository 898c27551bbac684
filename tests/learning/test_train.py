"""Training runs: resumed, watched on other plants, exported; and bad input."""

import os
import pickle
import sys

import numpy as np
import pytest
import yaml

from smo_gym.cli import train
from smo_gym.evaluation import configs
from smo_gym.learning import measurement, settings, training
from smo_gym.policies import MlpPolicy


@pytest.fixture
def command(tmp_path):
    """A command line that trains for some tenths of a second: two checkpoints on the way."""
    small = yaml.safe_load(configs.path("ppo").read_text())
    small["SMOPendulum-v0"] |= {"n_envs": 8, "n_timesteps": 96, "n_steps": 4, "batch_size": 32, "n_epochs": 1}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(small))

    def command(*arguments, out="run"):
        return train.main(["--config", str(tmp_path / "small.yaml"), "--out", str(tmp_path / out), *arguments])

    return command


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Evaluations over a second."""
    measure = training.measure
    monkeypatch.setattr(training, "measure", lambda policy, stream=measurement.TEST: measure(policy, stream, 5, 1.0))


def test_an_interrupted_run_ends_where_an_uninterrupted_one_does(command, tmp_path, monkeypatch, capsys):
    assert command(out="whole") == 0
    keep = training.Watch.keep

    def interrupt(watch):
        keep(watch)
        if watch.num_timesteps == 32:  # not 64: the learning rate has fallen to 0 in what follows
            raise KeyboardInterrupt

    monkeypatch.setattr(training.Watch, "keep", interrupt)
    assert command() == 130
    assert "resumes" in capsys.readouterr().err
    assert not (tmp_path / "run/policy.safetensors").exists()
    monkeypatch.setattr(training.Watch, "keep", keep)
    assert command() == 0
    whole, resumed = (MlpPolicy.load(tmp_path / name / "policy.safetensors") for name in ("whole", "run"))
    assert all(np.array_equal(W, V) for (W, _), (V, _) in zip(whole.layers, resumed.layers, strict=True))
    assert whole.card.curve == resumed.card.curve
    assert [point["steps"] for point in whole.card.curve] == [32, 64, 96]
    assert whole.card.measured == resumed.card.measured
    assert whole.card.command.startswith("smo-gym train --config ")
    assert whole.card.configuration["options"]["uncertainty"] == 0.2
    before = (tmp_path / "run/policy.safetensors").read_bytes()
    assert command() == 0  # nothing is left to do
    assert (tmp_path / "run/policy.safetensors").read_bytes() == before


def test_seeds_lead_to_other_policies(command, tmp_path):
    policies = []
    for seed in ("0", "1"):
        assert command("--seed", seed, "--steps", "32", out=seed) == 0
        policies.append(MlpPolicy.load(tmp_path / seed / "policy.safetensors"))
    assert not np.array_equal(policies[0].layers[0][0], policies[1].layers[0][0])


def test_first_episodes_end_out_of_step_on_one_reference(tmp_path, monkeypatch):
    """Cutting an episode short must not move the clock that the reference is read by."""
    done, desired = [], []

    class Spy(training.SB3VecEnv):
        def step_wait(self):
            result = super().step_wait()
            done.append(result[2])
            desired.append(self.vector_info["desired"])
            return result

    monkeypatch.setattr(training, "SB3VecEnv", Spy)
    options = {"horizon": 0.32, "track_limit": None, "angle_limit": None}
    hyperparameters = {"policy": "MlpPolicy", "n_steps": 16, "batch_size": 32, "n_epochs": 1}
    training.train(settings.Run("SMOPendulumTracking-v0", "smo", "ppo", 0, 64, 4, options, hyperparameters), tmp_path)
    first = np.argmax(done, axis=0)
    assert np.all(done, axis=1).sum() == 0 < np.any(done, axis=0).sum()
    assert len(set(first)) > 1
    before = [step[first > k] for k, step in enumerate(desired[: first.max()])]
    assert all(np.array_equal(slots, np.repeat(slots[:1], len(slots), axis=0)) for slots in before)
    assert not np.array_equal(before[0][0], before[-1][0])


def test_another_configuration_does_not_resume(command, capsys):
    assert command() == 0
    assert command("--seed", "3", "--uncertainty", "0.1") == 2
    message = capsys.readouterr().err
    assert "another configuration: seed is 0 there and 3 here; options.uncertainty is 0.2 there and 0.1 here" in message
    assert "Choose another --out, or remove that folder" in message


class _Evil:
    def __init__(self, to):
        self.to = to

    def __reduce__(self):
        return os.system, (f"touch {self.to}",)


def test_no_file_that_lies_there_runs_code(command, tmp_path, capsys):
    """A checkpoint holds tensors and numbers; a pickle in its place is refused, one beside it is not opened."""
    assert command("--steps", "32") == 0
    evil = pickle.dumps(_Evil(tmp_path / "ran"))
    for name in ("checkpoint.zip", "state.pkl"):
        (tmp_path / "run" / name).write_bytes(evil)
    assert command("--steps", "32") == 0
    for name in ("checkpoint.pt", "run.json", "best.safetensors"):
        kept = (tmp_path / "run" / name).read_bytes()
        (tmp_path / "run" / name).write_bytes(evil)
        assert command("--steps", "32") == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
        (tmp_path / "run" / name).write_bytes(kept)
    (tmp_path / "run" / "checkpoint.pt").unlink()
    assert command("--steps", "32") == 2
    assert "checkpoint.zip: is of an older version and is not opened" in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()


def test_a_damaged_checkpoint_is_named(command, tmp_path, capsys):
    assert command("--steps", "32") == 0
    checkpoint = tmp_path / "run/checkpoint.pt"
    checkpoint.write_bytes(checkpoint.read_bytes()[:-40])
    assert command("--steps", "32") == 2
    assert "checkpoint.pt: cannot be read" in capsys.readouterr().err


def test_a_checkpoint_without_its_hyperparametersis_of_nobody_knows_what(command, tmp_path, capsys):
    assert command("--steps", "32") == 0
    run = tmp_path / "run/run.json"
    for text in ("[]", "{", None):
        run.write_text(text) if text else run.unlink()
        assert command("--steps", "32", "--seed", "3") == 2
        assert "run.json: cannot be read" in capsys.readouterr().err
    assert not run.exists()


def test_an_interruption_before_anything_is_there(monkeypatch, capsys):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(settings, "load", interrupt)
    assert train.main([]) == 130
    assert "interrupted before it began" in capsys.readouterr().err


def test_what_cannot_be_frozen_is_not_trained(tmp_path):
    plain = settings.load(configs.path("ppo"), "SMOPendulum-v0", "ppo", steps=32)
    recurrent = settings.load(configs.path("ppo_lstm"), "SMOPendulum-v0", "recurrent", steps=32)
    squashed = {"use_sde": True, "policy_kwargs": {"squash_output": True}}
    for run, change, message in [
        (plain, squashed, "squash_output=True"),
        (recurrent, {"policy_kwargs": {"n_lstm_layers": 2}}, "lstm has 2 layers"),
    ]:
        small = {"n_steps": 8, "batch_size": 16, **change}
        with pytest.raises(ValueError, match=message):
            training.train(training.replace(run, n_envs=4, hyperparameters=run.hyperparameters | small), tmp_path)
        assert not list(tmp_path.iterdir())


def test_streams_of_seeds_share_nothing():
    """Slot i of a batch seeded with s has s + i: not the first seeds alone, all of the slots' must differ."""
    slots = {"training": [], "others": []}
    for seed in range(5):
        for steps in range(0, 2_000_000, 98_304):
            first = measurement.seeds(measurement.TRAINING, 1, seed, steps)[0]
            slots["training"] += range(first, first + 256)
    for stream in (measurement.VALIDATION, measurement.TEST):
        first = measurement.seeds(stream, 1)[0]
        slots["others"] += range(first, first + 100)
    everything = slots["training"] + slots["others"]
    assert len(set(everything)) == len(everything) == 5 * 21 * 256 + 200


def test_the_recurrent_algorithm_learns_and_is_exported(tmp_path, monkeypatch):
    run = settings.load(configs.path("ppo_lstm"), "SMOPendulum-v0", "recurrent", steps=32)
    small = training.replace(
        run, n_envs=4, hyperparameters=run.hyperparameters | {"n_steps": 8, "batch_size": 16, "n_epochs": 1}
    )
    policy = training.train(small, tmp_path)
    assert policy.card.lstm == 64
    assert policy.card.observation == "positions"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--env", "SMOPendulum-v1"], "unknown environment 'SMOPendulum-v1': did you mean 'SMOPendulum-v0'"),
        (["--observation", "positons"], "did you mean 'positions'"),
        (["--algo", "recurrent", "--observation", "smo"], "is for 'positions' alone"),
        (["--uncertainty", "1.5"], "--uncertainty: '1.5' must be a fraction"),
        (["--seed", "-1"], "--seed: '-1' must be a whole number of at least 0"),
        (["--steps", "0"], "error: argument --steps: '0' must be a whole number of at least 1\n"),
        (["--config", "nowhere.yaml"], "nowhere.yaml: cannot be read"),
    ],
)
def test_bad_arguments(arguments, message, tmp_path, capsys):
    assert train.main([*arguments, "--out", str(tmp_path / "run")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("smo-gym train: error: ")
    assert message in error
    assert not (tmp_path / "run").exists()


def test_a_bad_setting_leaves_no_folder(tmp_path, capsys):
    data = yaml.safe_load(configs.path("ppo").read_text())
    data["SMOPendulum-v0"]["batch_size"] = 1
    (tmp_path / "bad.yaml").write_text(yaml.safe_dump(data))
    assert train.main(["--config", str(tmp_path / "bad.yaml"), "--out", str(tmp_path / "run")]) == 2
    assert "bad.yaml: hyperparameters: AssertionError" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_missing_extra_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    for name in ("training", "settings", "sb3"):
        monkeypatch.delitem(sys.modules, f"smo_gym.learning.{name}", raising=False)
        monkeypatch.delattr(f"smo_gym.learning.{name}")
    assert train.main([]) == 2
    assert 'pip install "smo_gym[rl]"' in capsys.readouterr().err
