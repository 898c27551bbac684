"""Training on, from a finished run to a longer one, and what is said of it."""

import json

import gymnasium
import numpy as np
import pytest
import yaml

from smo_gym import ObserverWrapper
from smo_gym.cli import train, watch
from smo_gym.evaluation import configs
from smo_gym.learning import measurement, training
from smo_gym.policies import MlpPolicy
from smo_gym.wrappers.view import KINDS


@pytest.fixture
def command(tmp_path, monkeypatch):
    """A command line that trains for some tenths of a second, evaluated over a second."""
    small = yaml.safe_load(configs.path("ppo").read_text())
    small["SMOPendulum-v0"] |= {"n_envs": 8, "n_steps": 4, "batch_size": 32, "n_epochs": 1}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(small))
    measure = training.measure
    monkeypatch.setattr(training, "measure", lambda policy, stream=measurement.TEST: measure(policy, stream, 5, 1.0))

    def command(steps, *arguments, out="run"):
        options = ["--config", str(tmp_path / "small.yaml"), "--out", str(tmp_path / out), "--steps", str(steps)]
        return train.main([*options, *arguments])

    return command


def test_more_steps_go_on_from_a_finished_training_and_can_be_interrupted(command, tmp_path, monkeypatch):
    for out in ("whole", "cut"):
        assert command(64, out=out) == 0
    first = MlpPolicy.load(tmp_path / "whole" / "policy.safetensors").card
    assert "continues" not in first.configuration
    assert command(160, out="whole") == 0
    keep = training.Watch.keep

    def interrupt(watch):
        keep(watch)
        if watch.num_timesteps == 96:
            raise KeyboardInterrupt

    monkeypatch.setattr(training.Watch, "keep", interrupt)
    assert command(160, out="cut") == 130
    monkeypatch.setattr(training.Watch, "keep", keep)
    assert command(160, out="cut") == 0
    whole, cut = (MlpPolicy.load(tmp_path / name / "policy.safetensors") for name in ("whole", "cut"))
    assert [point["steps"] for point in whole.card.curve] == [32, 64, 96, 128, 160]
    assert whole.card.curve[:2] == first.curve
    assert whole.card.curve == cut.card.curve
    assert all(np.array_equal(W, V) for (W, _), (V, _) in zip(whole.layers, cut.layers, strict=True))
    assert (whole.card.configuration["steps"], whole.card.configuration["continues"]) == (160, [64])
    assert command(192, out="whole") == 0
    assert json.loads((tmp_path / "whole" / "run.json").read_text())["continues"] == [64, 160]


def test_what_does_not_go_on_is_one_line_and_changes_nothing(command, tmp_path, monkeypatch, capsys):
    keep = training.Watch.keep

    def interrupt(watch):
        keep(watch)
        raise KeyboardInterrupt

    monkeypatch.setattr(training.Watch, "keep", interrupt)
    assert command(64) == 130
    monkeypatch.setattr(training.Watch, "keep", keep)
    capsys.readouterr()
    assert command(96) == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert "steps=96" in line
    assert "unfinished run of 64 steps" in line
    assert command(64) == 0
    assert command(32) == 2
    assert "steps is 64 there and 32 here" in capsys.readouterr().err
    assert command(96, "--seed", "1") == 2
    error = capsys.readouterr().err
    assert "seed is 0 there and 1 here" in error
    assert "--out" in error
    assert json.loads((tmp_path / "run" / "run.json").read_text())["steps"] == 64


def test_the_end_says_what_was_measured_and_how_to_watch_it(command, tmp_path, capsys):
    assert command(32) == 0
    text = capsys.readouterr().out
    measured = MlpPolicy.load(tmp_path / "run" / "policy.safetensors").card.measured
    assert (
        f"none of 5 runs failed in 1 s; return {measured['return']:.4g}; MSE of h {measured['mse_h']:.3g} m^2" in text
    )
    assert text.splitlines()[-1] == f"    smo-gym watch {tmp_path / 'run'}"
    film = tmp_path / "film.gif"
    assert watch.main([str(tmp_path / "run"), "--seconds", "0.2", "--out", str(film)]) == 0
    assert film.read_bytes()[:3] == b"GIF"


@pytest.mark.parametrize(
    ("failed", "said"),
    [(2, "2 of 5 runs failed; they stood 3.5 s on average; return -20; MSE of h 1 m^2"), (5, "5 of 5 runs failed;")],
)
def test_failures_are_said(failed, said):
    means = {"mse_h": 1.0, "mse_theta": 2.0} if failed < 5 else {}
    assert train.in_words({"runs": 5, "failed": failed, "return": -20.0, "standing": 3.5, **means}).startswith(said)


def test_the_return_is_the_sum_of_an_episodes_rewards(command, tmp_path):
    assert command(32) == 0
    policy = MlpPolicy.load(tmp_path / "run" / "policy.safetensors")
    found = measurement.measure(policy, runs=1, horizon=1.0)
    env = gymnasium.make("SMOPendulum-v0", **(policy.card.configuration["options"] | {"horizon": 1.0}))
    env = ObserverWrapper(env, **KINDS["smo"].observer)
    observation, _ = env.reset(seed=measurement.seeds(measurement.TEST, 1)[0])
    total, over = 0.0, False
    while not over:
        action, _ = policy.predict(observation)
        observation, reward, terminated, truncated, _ = env.step(action)
        total, over = total + reward, terminated or truncated
    assert found["return"] == pytest.approx(total, rel=1e-12)
    assert found["standing"] == 1.0
