"""Policies and agents of one's own in the tables of smo-gym evaluate."""

import csv
import json
import re
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import yaml
from conftest import ROOT
from stable_baselines3 import PPO, SAC

from smo_gym import SlidingModeObserver
from smo_gym.cli import evaluate
from smo_gym.evaluation import configs, scenario
from smo_gym.policies.frozen import Card, MlpPolicy
from smo_gym.wrappers.view import KINDS, agent_view

PAGE = (ROOT / "docs" / "how-to" / "own-agent.md").read_text(encoding="utf-8")

# the gain of configs/article.yaml
TWIN = """
class Twin:
    K = (7.197, -4.026, 10.96, -0.9999)
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        x = observation[:, 2:]
        return -(self.K[0] * x[:, 0] + self.K[1] * x[:, 1] + self.K[2] * x[:, 2] + self.K[3] * x[:, 3])[:, None], state
class Slow(Twin):
    control_period = 0.02
class Odd(Twin):
    control_period = 0.0215
class Wide(Twin):
    def predict(self, *arguments):
        return super().predict(*arguments)[0][:, 0], None
class Fast(Twin):
    control_period = "fast"
class Timeless(Twin):
    control_period = None
class Late(Twin):
    def predict(self, observation, state=None, *others):
        return Twin.predict(self, observation)[0], 1 / (3 - (state or 0)) and (state or 0) + 1
class Lost(Twin):
    def predict(self, observation, state=None, *others):
        return observation[:, :1] * (1.0 if state is None else float("nan")), ()
class Mute:
    pass
class Needy(Twin):
    def __init__(self, gain):
        self.gain = gain
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with agents and a scenario of a second."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "twins", raising=False)
    (tmp_path / "twins.py").write_text(TWIN)
    (tmp_path / "leaves.py").write_text("raise SystemExit(3)\n")
    short = {"extends": "regulation"}
    short |= {"horizon": {"value": 1.0, "source": "chosen"}, "uncertainty": {"value": [0.2], "source": "chosen"}}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(short))
    return tmp_path


def runs(*arguments, config="short.yaml"):
    """Rows of runs.csv by controller."""
    assert evaluate.main(["--config", config, "--runs", "3", "--out", "out", *arguments]) == 0
    found = {}
    with open("out/runs.csv", newline="") as file:
        for row in csv.DictReader(file):
            found.setdefault(row.pop("controller"), []).append(row)
    return found


def linear(path, observation="smo", environment="SMOPendulum-v0", **options):
    """A policy of one layer: u = -3 h, and the force limit 10."""
    size = 2 if observation == "positions" else 6
    units = np.array([1.0, 1.0, 1.0, 1.0, 2.0, 4.0])[:size]
    card = Card(
        environment=environment,
        observation=observation,
        units=tuple(units),
        frames=1,
        layers=(size, 1),
        force_limit=10.0,
        configuration={"options": options},
    )
    MlpPolicy(card, [(-0.3 * np.eye(1, size), np.zeros(1))]).save(Path(path))
    return path


def test_an_lqr_of_ones_own_gives_the_numbers_of_lqr(here):
    found = runs("--controller", "lqr", "twins:Twin", "--observer", "all", "--force-limit", "30")
    assert len(found["lqr"]) == 4 * 4  # arms times (3 runs and the nominal plant)
    assert found["twins:Twin"] == found["lqr"]
    assert max(float(row["peak_force"]) for row in found["lqr"]) == 30.0
    text = (here / "out" / "tables.md").read_text()
    assert "Table 4, twins:Twin" in text
    assert r"twins:Twin" in (here / "out" / "tables.tex").read_text()


def test_an_agent_acts_at_its_own_control_period(here):
    slow = runs("--controller", "twins:Slow")["twins:Slow"]
    every_20_ms = yaml.safe_load((here / "short.yaml").read_text())
    every_20_ms["control_period"] = {"value": 0.02, "source": "chosen"}
    (here / "slow.yaml").write_text(yaml.safe_dump(every_20_ms))
    assert slow == runs("--controller", "lqr", config="slow.yaml")["lqr"]
    assert slow != runs("--controller", "lqr")["lqr"]


def test_the_shipped_policy_is_the_one_in_its_file(here):
    path = str(ROOT / "smo_gym" / "policies" / "baselines" / "pendulum.safetensors")
    found = runs("--controller", "ppo", path, "--observer", "theorem")
    assert found["ppo"] == found[path]
    assert "Table 4, PPO" in (here / "out" / "tables.md").read_text()


@pytest.mark.parametrize("options", [{}, {"control_period": 0.01}])
def test_a_policy_acts_at_the_control_period_of_its_card(here, options):
    linear("a.safetensors", "positions", **options)
    (here / "same.py").write_text(
        f"import numpy as np\nclass Same:\n    control_period = {options.get('control_period', 0.02)}\n"
        "    def predict(self, observation, state=None, episode_start=None, deterministic=True):\n"
        "        return 10.0 * np.clip(observation[:, :1] * -0.3, -1.0, 1.0), None\n"
    )
    sys.modules.pop("same", None)
    found = runs("--controller", "a.safetensors", "same:Same")
    numbers = [[[float(v) for k, v in row.items() if v and k != "arm"] for row in rows] for rows in found.values()]
    assert np.array(numbers[0]) == pytest.approx(np.array(numbers[1]), rel=1e-9, abs=1e-12)
    assert float(found["same:Same"][0]["peak_force"]) > 4.0


def test_models_of_stable_baselines3_act_as_their_library_says(here):
    for name, algorithm, kind in (("a.zip", PPO, "smo"), ("b.zip", SAC, "stacked"), ("c.zip", PPO, "positions")):
        model = algorithm("MlpPolicy", agent_view(gymnasium.make("SMOPendulum-v0"), kind), seed=1, device="cpu")
        model.save(name)
        agent = scenario.load(Path("short.yaml")).with_agent(name).agent(name)
        seen = np.random.default_rng(0).normal(size=(5, 1, 6))
        state, frames = None, []
        for k, observation in enumerate(seen):
            size = 6 if kind == "smo" else 2
            frames.append(observation[0, :size] / np.array([1, 1, 1, 1, 2, 4])[:size])
            stack = [frames[max(k - i, 0)] for i in (3, 2, 1, 0)] if kind == "stacked" else [frames[k]]
            wanted, _ = model.predict(np.concatenate(stack).astype(np.float32), deterministic=True)
            force, state = agent.predict(observation, state, np.array([k == 0]), True)
            assert force == pytest.approx(30.0 * wanted[None].astype(float), abs=1e-4)
        assert agent.control_period == 0.02
    assert len(runs("--controller", "a.zip", "b.zip", "lqr")) == 3


def named_in_a_scenario(here, **changes):
    """A scenario file with controllers whose agents have these names."""
    data = yaml.safe_load((here / "short.yaml").read_text())
    smc = yaml.safe_load(configs.path("article").read_text())["controllers"]["smc"]
    data["controllers"] = {
        name: {"law": "policy", "agent": agent, "observer": smc["observer"]} for name, agent in changes.items()
    }
    (here / "own.yaml").write_text(yaml.safe_dump(data))
    return "own.yaml"


def test_a_scenario_names_trained_policies_too(here):
    linear("a.safetensors")
    found = runs(
        "--controller", "mine", "theirs", "lqr", config=named_in_a_scenario(here, mine="a.safetensors", theirs="ppo")
    )
    assert found["mine"] != found["theirs"] != found["lqr"]


@pytest.mark.parametrize("agent", ["a.zip", "twins:Twin", "twins:Twin.safetensors.zip", "twins", "A.ZIP", ""])
def test_a_scenario_runs_no_code(here, agent, capsys):
    (here / "twins.py").write_text("import pathlib\npathlib.Path('ran').touch()\n" + TWIN)
    config = named_in_a_scenario(here, mine=agent)
    for controller in ("mine", "lqr"):  # chosen or not
        assert evaluate.main(["--config", config, "--controller", controller]) == 2
        error = capsys.readouterr().err
        assert "controllers.mine.policy.agent: a file may name ppo or PATH.safetensors alone" in error
        assert "--controller PATH.zip or module:Class" in error
        assert error.count("\n") == 1
    assert not (here / "ran").exists()
    (here / "own.yaml").write_text("extends: regulation\nenvironment: twins:SMOPendulum-v0\n")
    assert evaluate.main(["--config", config]) == 2
    error = capsys.readouterr().err
    assert "environment: a file may not name a module to import: say 'SMOPendulum-v0', and --import twins" in error
    assert error.count("\n") == 1
    assert not (here / "ran").exists()
    assert evaluate.main(["--config", "short.yaml", "--import", "twins", "--controller", "lqg"]) == 2
    assert (here / "ran").exists()  # whoever names it on the command line wants it


def test_no_other_policy_is_opened_than_those_that_run(here):
    config = named_in_a_scenario(here, mine="none.safetensors")
    assert set(runs("--controller", "lqr", config=config)) == {"lqr"}
    for controller in ("mine", "policy", "all"):
        assert evaluate.main(["--config", config, "--controller", controller]) == 2
    with pytest.raises(ValueError, match=r"own\.yaml: none\.safetensors: cannot be read"):
        scenario.load(Path(config))


def test_who_cannot_act_somewhere_is_left_out_there(here, capsys):
    linear("a.safetensors")
    assert evaluate.main(["--controller", "a.safetensors", "--scenario", "tracking"]) == 2
    assert "was trained for SMOPendulum-v0, not for SMOPendulumTracking-v0" in capsys.readouterr().err
    scenarios = [scenario.load(Path("short.yaml")), scenario.named("tracking")]
    more, names, left_out = evaluate.chosen(scenarios, ["a.safetensors", "smc"])
    assert names == ["a.safetensors", "smc"]
    assert ["a.safetensors" in place.controllers for place in more] == [True, False]
    assert [line.split(":")[0] for line in left_out] == ["left out of Tracking"]
    with pytest.raises(ValueError, match="no policy is shipped for SMOPendulumTracking-v0, only for"):
        evaluate.chosen(scenarios[1:], ["ppo"])


def test_training_and_tables_have_the_same_observer():
    observer = scenario.named("regulation").controllers["lqr"].observer
    for kind, compensation in (("smo", True), ("smo-uncompensated", False)):
        settings = {name: value for name, value in KINDS[kind].observer.items() if name != "observer"}
        assert SlidingModeObserver(**settings).as_dict() == observer.build(compensation).as_dict()


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        ("pppo", "unknown controller 'pppo': did you mean 'ppo'? known are"),
        ("nowhere:Twin", "cannot import 'nowhere' (ModuleNotFoundError: No module named 'nowhere')"),
        ("twins:Twn", "unknown class in twins 'Twn': did you mean 'Twin'?"),
        ("twins:Mute", "has no method predict(observation, state, episode_start, deterministic)"),
        ("twins:Needy", "cannot be made without arguments (TypeError:"),
        ("twins:Wide", "action has shape (2,), it must have shape (2, 1)"),
        ("twins:Odd", "control_period=0.0215 must be a whole multiple of the integration step dt=0.001"),
        ("twins:Fast", "twins:Fast.control_period='fast' must be a finite number greater than 0"),
        ("twins:Timeless", "twins:Timeless.control_period=None must be a finite number greater than 0"),
        ("twins:Late", "twins:Late: cannot act at t = 0.003 s (ZeroDivisionError: division by zero); nothing was"),
        ("leaves:Twin", "leaves:Twin: cannot import 'leaves' (SystemExit: 3)"),
        ("twins:Lost", "must be finite; nothing was written"),
        ("none.safetensors", "none.safetensors: cannot be read"),
        ("cut.safetensors", "cut.safetensors: is corrupt"),
        ("upright.safetensors", "was trained for SMOPendulumUpright-v0, not for SMOPendulum-v0"),
        ("wide.safetensors", "weights have shapes [(1, 6)], the card asks for [(2, 6)]"),
        ("none.zip", "none.zip: is no file"),
        ("cut.zip", "cut.zip: cannot be read as a model of Stable-Baselines3"),
        ("alien.zip", "alien.zip: observes Box("),
        ("newtons.zip", "newtons.zip: acts in Box(-30.0, 30.0"),
    ],
)
def test_bad_input_is_named_before_any_run(here, controller, message, capsys):
    if controller.endswith(".safetensors") and controller != "none.safetensors":
        linear(controller, environment="SMOPendulumUpright-v0" if "upright" in controller else "SMOPendulum-v0")
    if controller == "wide.safetensors":
        card = json.loads((here / "wide.json").read_text())
        (here / "wide.json").write_text(json.dumps(card | {"layers": [6, 2]}))
    alien = {"alien.zip": "Pendulum-v1", "newtons.zip": "SMOPendulum-v0"}.get(controller)
    if alien:
        PPO("MlpPolicy", gymnasium.make(alien), device="cpu").save(controller)
    if controller.startswith("cut"):
        path = here / controller
        path.write_bytes(path.read_bytes()[:-9] if path.exists() else b"PK\x03\x04")
    assert evaluate.main(["--config", "short.yaml", "--controller", controller, "lqr", "--out", "out"]) == 2
    error = capsys.readouterr().err
    assert "smo-gym evaluate: error: " in error
    assert message in error
    assert not list(here.glob("out/*"))


def test_a_missing_extra_is_named(here, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.save_util", None)
    monkeypatch.delitem(sys.modules, "smo_gym.policies.sb3_zip", raising=False)
    monkeypatch.delattr("smo_gym.policies.sb3_zip", raising=False)
    assert evaluate.main(["--config", "short.yaml", "--controller", "a.zip"]) == 2
    assert 'pip install "smo_gym[rl]"' in capsys.readouterr().err


def test_the_pages_agent_runs_as_it_stands(here, monkeypatch, capsys):
    agent, in_python = re.findall(r"```python(?: title=.+?)?\n(.*?)```", PAGE, re.DOTALL)
    (here / "my_agent.py").write_text(agent)
    monkeypatch.delitem(sys.modules, "my_agent", raising=False)
    (command,) = re.findall(r"python agents/evaluate.py (--controller .*?) --scenario", PAGE)
    found = runs(*command.split())
    assert list(found) == ["lqr", "my_agent:SmoothLqr"]
    assert found["my_agent:SmoothLqr"] != found["lqr"]
    capsys.readouterr()
    exec(compile(in_python.replace("100", "5"), "own-agent.md", "exec"), {})
    mse, failed = capsys.readouterr().out.split()
    assert 0.0 < float(mse) < 1.0
    assert failed == "0"
    (settings,) = re.findall(r"```yaml(?: title=.+?)?\n(.*?)```", PAGE, re.DOTALL)
    (here / "mine.yaml").write_text(settings)
    assert isinstance(scenario.load(Path("mine.yaml")).agent("mine"), MlpPolicy)
