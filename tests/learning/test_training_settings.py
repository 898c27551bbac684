"""Files of settings in the zoo's shape: what is taken, and what is refused before anything is made."""

import re

import pytest
import yaml
from conftest import CONFIGS

from smo_gym.evaluation import scenario
from smo_gym.learning import settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learning_rat": 1e-3}, "unknown hyperparameter 'learning_rat': did you mean 'learning_rate'"),
        ({"device": "cpu"}, "unknown hyperparameter 'device'"),
        ({"tensorboard_log": "x"}, "unknown hyperparameter 'tensorboard_log'"),
        ({1: 2}, "unknown hyperparameter 1"),
        ({"env_wrapper": ["a.b"]}, "env_wrapper="),
        ({"env_wrapper": [3]}, "env_wrapper=[3] must be a list of"),
        ({"env_wrapper": [{settings.VIEW: None}]}, "argument of agent_view: None must be a mapping"),
        ({"env_wrapper": [{settings.VIEW: {"observatio": "smo"}}]}, "did you mean 'observation'"),
        ({"env_kwargs": {"horizn": 1.0}}, "did you mean 'horizon'"),
        ({"env_kwargs": None}, "env_kwargs=None must be a mapping"),
        ({"n_envs": 2.7}, "n_envs=2.7 must be a positive integer"),
        ({"n_envs": True}, "n_envs=True must be a positive integer"),
        ({"n_timesteps": 2.5}, "n_timesteps=2.5 must be a positive integer"),
        ({"n_steps": "many"}, "n_steps='many' must be"),
        ({"batch_size": "x"}, "batch_size='x' must be a positive integer"),
        ({"batch_size": 0}, "batch_size=0 must be a positive integer"),
        ({"batch_size": 1}, "hyperparameters: AssertionError"),
        ({"policy": "MlpPolic"}, "hyperparameters: ValueError"),
        ({"policy_kwargs": "dict(net_arch=[64])"}, "policy_kwargs='dict(net_arch=[64])' must be a mapping"),
        ({"policy_kwargs": {"net_arc": [64]}}, "hyperparameters: TypeError"),
        ({"gamma": 7}, "gamma=7 must be a number from 0 to 1"),
        ({"gamma": "x"}, "gamma='x' must be a number"),
        ({"gamma": None}, "gamma=None must be a number"),
        ({"learning_rate": float("nan")}, "'.nan' is no finite number"),
        ({"learning_rate": "lin_nan"}, "learning_rate='lin_nan' must be"),
        ({"learning_rate": "lin_fast"}, "learning_rate='lin_fast' must be"),
    ],
)
def test_bad_settings(change, message, tmp_path):
    data = yaml.safe_load((CONFIGS / "ppo.yaml").read_text())
    data["SMOPendulum-v0"] |= {"n_envs": 4, "batch_size": 64} | change
    (tmp_path / "bad.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(ValueError, match=f"bad.yaml: .*{re.escape(message)}"):
        settings.load(tmp_path / "bad.yaml", "SMOPendulum-v0", "ppo")


def test_what_the_zoo_takes_is_taken(tmp_path):
    data = yaml.safe_load((CONFIGS / "ppo.yaml").read_text())
    data["SMOPendulum-v0"] |= {"n_timesteps": 1e3, "target_kl": None, "clip_range": "lin_0.2"}
    data["SMOPendulum-v0"]["env_wrapper"] = [{settings.VIEW: {}}]
    (tmp_path / "zoo.yaml").write_text(yaml.safe_dump(data))
    run = settings.load(tmp_path / "zoo.yaml", "SMOPendulum-v0", "ppo")
    assert (run.steps, run.observation) == (1000, "smo")


def test_files_that_are_no_settings(tmp_path):
    path = tmp_path / "a.yaml"
    for content, message in [
        (b"\xff\xfe\x00", "is not YAML ('utf-8' codec"),
        (b"a: [", "is not YAML ("),
        (b"1: {}", "unknown environment 'SMOPendulum-v0': known are '1'"),
        (b"3", "must be a mapping"),
    ]:
        path.write_bytes(content)
        with pytest.raises(ValueError, match=re.escape(f"{path}: {message}")):
            settings.load(path, "SMOPendulum-v0", "ppo")
        with pytest.raises(ValueError, match="a.yaml: "):
            scenario.load(path)
