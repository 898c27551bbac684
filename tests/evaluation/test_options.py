"""Options of the environment in a scenario's file: they pass as they are, and what does not is named."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest

from smo_gym import CartPendulum
from smo_gym.evaluation import scenario, statistics, study
from smo_gym.evaluation.report import page, provenance

ROOT = Path(__file__).resolve().parents[2]
SMALL = f"""
extends: {ROOT}/configs/initial-conditions.yaml
horizon: {{value: 0.5, source: chosen}}
uncertainty: {{value: [0.1], source: chosen}}
"""
LONG = "options: {params: {value: {rod_length: 0.6}, source: chosen, note: a longer rod}}\n"


@pytest.fixture
def load(tmp_path):
    """A small scenario with more lines."""

    def make(more):
        path = tmp_path / "own.yaml"
        path.write_text(SMALL + more)
        return scenario.load(path)

    return make


@pytest.fixture
def long_rod():
    """A registered environment with a longer rod."""
    gymnasium.register(
        "LongRodOfATest-v0",
        entry_point="smo_gym.envs.pendulum:PendulumEnv",
        vector_entry_point="smo_gym.envs.vector:PendulumVectorEnv",
        kwargs={"params": {"rod_length": 0.6}},
    )
    yield "LongRodOfATest-v0"
    del gymnasium.registry["LongRodOfATest-v0"]


def measured(place):
    return study.measure(study.groups([place], ["lqr", "smc"], ["with", "theorem"], 2), seed=0, samples=10)


def test_a_longer_rod_runs_as_in_an_environment_registered_with_it(load, long_rod):
    ours, registered = measured(load(LONG)), measured(load(f"environment: {long_rod}\n"))
    for a, b in zip(ours, registered, strict=True):
        assert np.array_equal(a.plants, b.plants)
        assert all(np.array_equal(values, b.metrics[name]) for name, values in a.metrics.items())
        assert a.group.arm != "theorem" or np.array_equal(a.left, b.left)
    assert ours[0].plants[0].tolist() == [3.5, 0.32, 0.6, -9.8]
    shorter = measured(load(""))
    assert not np.array_equal(ours[0].metrics["mse_h"], shorter[0].metrics["mse_h"])


def test_the_design_is_for_the_scenarios_plant(load, monkeypatch):
    place = load(LONG)
    assert place.task.params == CartPendulum(rod_length=0.6)
    designed_for = []
    over = type(place.designed).over
    monkeypatch.setattr(
        type(place.designed), "over", lambda self, model: designed_for.append(model) or over(self, model)
    )
    for outcome in measured(place):
        assert outcome.left is None or outcome.group.arm == "theorem"
    assert designed_for
    assert {model.rod_length for model in designed_for} == {0.6}


def test_all_options_of_an_episode_pass(load):
    options = """
options:
  dt: {value: 0.0005, source: chosen}
  angle_limit: {value: 1.2, source: chosen, note: rad}
  reward: {value: {q: [1, 1, 0, 0]}, source: chosen}
"""
    task = load(options).task
    assert (task.dt, task.angle_limit, task.reward.q) == (0.0005, 1.2, (1.0, 1.0, 0.0, 0.0))
    assert task.horizon == 0.5


def test_they_stand_in_the_settings_with_their_source(load):
    pytest.importorskip("plotly")
    outcomes = measured(load(LONG))
    rows = {row["name"]: row for row in provenance.sources(outcomes)}
    assert rows["options.params"] | {"tables": ""} == {
        **{"name": "options.params", "value": "rod_length: 0.6", "source": "chosen", "note": "a longer rod"},
        "tables": "",
    }
    assert rows["plant.rod_length"]["note"] == "m; l; options.params"
    assert rows["plant.rod_length"]["source"] == "chosen"
    assert rows["plant.cart_mass"]["note"] == "kg; M_c; Table 2"
    text = page.render(outcomes, statistics.results(outcomes), "command", {"smo_gym": "0"})
    assert "<code>options.params</code>" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("parms: {value: {}, source: chosen}", "with options.parms: unknown environment option 'parms': did you mean"),
        (
            "params: {value: {rod_lenght: 1}, source: chosen}",
            "with options.params: unknown plant parameter 'rod_lenght': did",
        ),
        ("params: {value: {rod_length: -1}, source: chosen}", "with options.params: rod_length=-1 must be a finite"),
        ("params: {value: long, source: chosen}", "with options.params: params='long' must be an array of numbers"),
        ("angle_limit: {value: wide, source: chosen}", "with options.angle_limit: angle_limit='wide' must be a finite"),
        ("params: {value: {rod_length: 0.6}}", "options.params.source: Field required"),
        ("params: {rod_length: 0.6}", "options.params.rod_length: unknown setting 'rod_length'"),
        ("dt: {value: 1e-8, source: chosen}", "options.dt=1e-08 is less than a 10,000th of the control period"),
        ("horizon: {value: 5.0, source: chosen}", "options: 'horizon' does not belong here: it is the scenario's own"),
        ("reference: {value: null, source: chosen}", "own setting 'reference'"),
        ("initial_state: {value: [0, 0, 0, 0], source: chosen}", "own setting 'initial_states'"),
        ("uncertainty: {value: 0.2, source: chosen}", "own setting 'uncertainty'"),
        ("render_mode: {value: human, source: chosen}", "it is of how episodes are run, not of what they are"),
        ("max_episode_steps: {value: 3, source: chosen}", "it is of how episodes are run, not of what they are"),
    ],
)
def test_what_is_no_option_is_one_line_at_load(load, tmp_path, options, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        load(f"options: {{{options}}}\n")
    said = str(caught.value)
    assert message in said
    assert said.startswith(f"{tmp_path / 'own.yaml'}: ")
    assert "\n" not in said


def test_a_reference_is_not_followed_by_another_plant(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(f"extends: {ROOT}/configs/tracking.yaml\n{LONG}")
    with pytest.raises(ValueError, match=r"with options.params: reference was computed for the plant"):
        scenario.load(path)
