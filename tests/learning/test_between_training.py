"""Training with what stands between plant and computer."""

import json

import pytest
import yaml

from smo_gym.cli import train
from smo_gym.evaluation import configs
from smo_gym.learning import measurement, training
from smo_gym.policies import MlpPolicy


@pytest.fixture
def command(tmp_path, monkeypatch):
    measure = training.measure
    monkeypatch.setattr(training, "measure", lambda policy, stream=measurement.TEST: measure(policy, stream, 5, 1.0))
    small = yaml.safe_load(configs.path("ppo").read_text())
    small["SMOPendulum-v0"] |= {"n_envs": 8, "n_timesteps": 32, "n_steps": 4, "batch_size": 32, "n_epochs": 1}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(small))
    return lambda *more: train.main(["--config", str(tmp_path / "small.yaml"), "--out", str(tmp_path / "run"), *more])


def test_a_training_keeps_what_stands_between_and_does_not_go_on_without_it(command, tmp_path, capsys):
    given = ("--sensor", "encoders", "--disturbance", "{kind: step, force: 1.0}")
    assert command(*given) == 0
    kept = {"sensor": "encoders", "disturbance": {"kind": "step", "force": 1.0}}
    options = json.loads((tmp_path / "run/run.json").read_text())["options"]
    assert options.items() >= kept.items()
    assert MlpPolicy.load(tmp_path / "run/policy.safetensors").card.configuration["options"] == options
    assert command(*given) == 0
    capsys.readouterr()
    assert command() == 2
    assert "options.sensor is 'encoders' there and missing here" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--sensor", "encodr"), "did you mean 'encoders'?"),
        (("--disturbance", "math:sin"), "unknown disturbance 'math:sin'"),
    ],
)
def test_a_bad_value_is_named_before_training(command, capsys, given, said):
    assert command(*given) == 2
    assert said in capsys.readouterr().err


def test_lqr_stands_beside_a_policy_on_its_test_plants(command, tmp_path, capsys):
    assert command() == 0
    shown = " ".join(capsys.readouterr().out.split())
    card = MlpPolicy.load(tmp_path / "run/policy.safetensors").card
    beside = measurement.measure_lqr(card, 5)
    assert f"LQR on the same plants, on SMO estimates, as often: {train.in_words(beside)}" in shown
    assert beside["runs"] == card.measured["runs"]
    assert measurement.measure_lqr(card.model_copy(update={"environment": "of-another-kind"}), 5) is None
