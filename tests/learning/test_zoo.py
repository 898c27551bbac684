"""What is said of RL Baselines3 Zoo: it reads the hyperparameters unchanged, and how it evaluates."""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest
import yaml
from conftest import CONFIGS

from smo_gym.policies import sb3_zip


@pytest.mark.skipif(importlib.util.find_spec("rl_zoo3") is None, reason="needs: pip install rl_zoo3")
@pytest.mark.parametrize(("algorithm", "file"), [("ppo", "ppo.yaml"), ("ppo_lstm", "ppo_lstm.yaml")])
def test_the_zoo_reads_the_hyperparameters(algorithm, file, tmp_path):
    data = yaml.safe_load((CONFIGS / file).read_text())
    data["SMOPendulum-v0"] |= {"n_envs": 2, "n_steps": 16, "batch_size": 16}
    data["SMOPendulum-v0"]["env_kwargs"]["horizon"] = 0.1  # 5 steps
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(data))
    command = f"-m rl_zoo3.train --algo {algorithm} --env SMOPendulum-v0 --gym-packages smo_gym --conf-file small.yaml"
    options = "--n-timesteps 32 --eval-freq 32 --eval-episodes 2 --log-folder logs --seed 0"
    subprocess.run([sys.executable, *command.split(), *options.split()], cwd=tmp_path, check=True, capture_output=True)
    run = tmp_path / "logs" / algorithm / "SMOPendulum-v0_1"
    policy = sb3_zip.load(run / "SMOPendulum-v0.zip")
    assert len(policy.units) == (6 if algorithm == "ppo" else 2)
    trained = [line.split(",")[1] for line in (run / "0.monitor.csv").read_text().splitlines()[2:]]
    assert set(trained) == {"5"}
    evaluated = np.load(run / "evaluations.npz")["ep_lengths"]
    assert (evaluated > 5).all()  # on the environment's defaults, not on env_kwargs
