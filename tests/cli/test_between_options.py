"""What stands between plant and computer, on the command line of an evaluation."""

from functools import partial

import pytest
import yaml
from conftest import SMALL

from smo_gym.evaluation import between, scenario, statistics, study
from smo_gym.evaluation.store import Store

OWN = "def push(t, h, theta, h_dot, theta_dot):\n    return 0.1, 0.0\n"


@pytest.fixture
def evaluate(command, tmp_path):
    arguments = ("--controller", "lqr", "--config", SMALL, "--runs", "1", "--uncertainty", "0.1", "--out", tmp_path)
    return partial(command, "evaluate", *arguments)


def test_what_stands_between_is_said_first_and_nothing_is_published_of_it(evaluate, tmp_path):
    shown = evaluate("--sensor", "encoders", "--friction", "{cart_viscous: 2.0}").stdout.splitlines()
    told = ["sensor: encoders, resolution=(0.0001, 0.001534)", "friction: cart_viscous=2", between.UNPUBLISHED]
    assert shown[:2] == told[:2]
    assert "published  measured" not in "\n".join(shown)
    assert yaml.safe_load((tmp_path / "settings.yaml").read_text())["between"] == told
    text = (tmp_path / "tables.md").read_text().replace("\\", "")
    assert text.startswith("\n\n".join(told))
    rows = (tmp_path / "results.csv").read_text().splitlines()
    column = rows[0].split(",").index("published")
    assert not any(row.split(",")[column] for row in rows[1:])


def test_what_is_exact_leaves_no_word(evaluate, tmp_path):
    shown = evaluate("--sensor", "exact").stdout
    assert shown.startswith("Each table")
    assert "published" in shown
    assert "between" not in yaml.safe_load((tmp_path / "settings.yaml").read_text())
    evaluate()
    assert "sensor" not in (tmp_path / "settings.yaml").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--sensor", "encodr"), "unknown sensor 'encodr': did you mean 'encoders'?"),
        (("--actuator", "{delai: 3}"), "did you mean 'delay'?"),
        (("--friction", "{"), "neither a name nor YAML"),
        (("--disturbance", "nowhere:push"), "nowhere:push: cannot import 'nowhere'"),
        (("--disturbance", "math:sim"), "unknown function in math 'sim'"),
    ],
)
def test_a_bad_value_is_named_before_any_run(evaluate, tmp_path, arguments, said):
    done = evaluate(*arguments, check=False)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "results.csv").exists()


def test_a_function_of_ones_own_is_written_by_its_name(evaluate, tmp_path, monkeypatch):
    (tmp_path / "pushing_of_mine.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    evaluate("--disturbance", "pushing_of_mine:push")
    settings = yaml.safe_load((tmp_path / "settings.yaml").read_text())
    assert settings["command"]["disturbance"] == "pushing_of_mine:push"
    assert settings["scenarios"][0]["options"]["disturbance"]["value"] == "pushing_of_mine:push"
    assert settings["between"][0].endswith("function=pushing_of_mine:push")


def test_a_file_may_not_name_a_function(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(f"extends: {SMALL}\noptions:\n  disturbance: {{value: 'mine:push', source: chosen}}\n")
    with pytest.raises(ValueError, match="a file may not name code: say --disturbance mine:push"):
        scenario.load(path)


def _push(t, h, theta, h_dot, theta_dot):
    return 0.1, 0.0


def test_what_a_function_pushes_is_not_kept(small, tmp_path):
    def key(value):
        place = small.changed(options={"disturbance": {"value": value, "source": "chosen"}})
        return Store(tmp_path).key(study.groups([place], ["lqr"], ["with"], 1)[0], 0, None)

    assert key(_push) is None
    assert key({"kind": "step", "force": 1.0}) is not None


def test_a_line_that_holds_for_some_tables_names_them(small):
    rubs = {"friction": {"value": {"cart_coulomb": 0.5}, "source": "chosen"}}
    places = [small, small.changed(table="5", options=rubs)]
    assert between.lines(places)[0] == "Table 5: friction: cart_coulomb=0.5"
    assert between.lines([small]) == []
    outcomes = study.measure(study.groups(places, ["lqr"], ["with"], 1), seed=0)
    published = {r.cell.table for r in statistics.results(outcomes) if r.published > 0.0}
    assert published == {"4"}


@pytest.mark.parametrize("controller", ["lqr", "who_asks:Agent"])
def test_a_disturbance_that_is_not_finite_is_named(command, tmp_path, monkeypatch, controller):
    (tmp_path / "not_finite.py").write_text(
        "import math\n\n\ndef push(t, h, theta, v, omega):\n    return (math.nan if t > 0.505 else 0.0), 0.0\n"
    )
    (tmp_path / "who_asks.py").write_text(
        "class Agent:\n    def predict(self, observation, state=None, episode_start=None, deterministic=True):\n"
        "        return 0.0 * observation[:, :1], None\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    options = ("--config", SMALL, "--runs", "1", "--uncertainty", "0.1", "--compensation", "on", "--out", tmp_path)
    monkeypatch.setattr("gymnasium.logger.min_level", 40)
    done = command("evaluate", "--controller", controller, "--disturbance", "not_finite:push", *options)
    said = " ".join(done.stdout.split())
    assert "0 %, with: its disturbance was not finite at t = 0.506 s, and that of 1 other run at some time." in said
    assert "2 of 2 runs failed" in said
