"""Settings that come with the package: found by name, in a checkout and in a wheel, and changed with checks."""

import pickle
import re
import tomllib
from pathlib import Path

import pytest

from smo_gym.evaluation import configs, scenario

ROOT = Path(__file__).resolve().parents[2]


def test_every_file_is_found_by_its_name():
    assert {configs.path(name) for name in configs.names()} == {*(ROOT / "configs").glob("*.yaml")}
    with pytest.raises(ValueError, match="unknown settings 'regulaton': did you mean 'regulation'"):
        configs.path("regulaton")


def test_an_installed_package_has_them_inside(tmp_path, monkeypatch):
    shipped = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert shipped == {"only-include": ["smo_gym", "configs"], "sources": {"configs": "smo_gym/configs"}}
    (tmp_path / "smo_gym" / "evaluation").mkdir(parents=True)
    monkeypatch.setattr(configs, "__file__", str(tmp_path / "smo_gym" / "evaluation" / "configs.py"))
    assert configs.folder() == tmp_path / "configs"
    (tmp_path / "smo_gym" / "configs").mkdir()
    assert configs.folder() == tmp_path / "smo_gym" / "configs"


def test_a_file_extends_one_of_ours_by_its_name(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("extends: regulation\nhorizon: {value: 2.0, source: chosen}\n")
    assert scenario.load(own) == scenario.named("regulation").changed(horizon=2.0)
    (tmp_path / "regulation").write_text("extends: tracking\n")  # a file beside it comes first
    assert scenario.load(own).title == "Tracking"
    own.write_text("extends: regulation.yml\n")
    with pytest.raises(ValueError, match=r"extends='regulation.yml' is no file: .*, or be one of article, "):
        scenario.load(own)


def test_what_changes_is_chosen_and_has_its_note():
    ours = scenario.named("tracking")
    other = ours.changed(horizon=5, uncertainty=[0.1], title="Brief", note="command line")
    assert (other.horizon.value, other.uncertainty.value, other.title) == (5.0, (0.1,), "Brief")
    assert {(s.source, s.note) for s in (other.horizon, other.uncertainty)} == {("chosen", "command line")}
    assert ours.horizon.value == 10.0
    assert other.changed(horizon=10.0).controllers == ours.controllers
    assert pickle.loads(pickle.dumps(other)) == other
    finer = ours.changed(reference=ours.reference.changed(elements=20))
    assert (finer.reference.elements.value, finer.reference.end) == (20, ours.reference.end)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"horizn": 5.0}, "unknown setting 'horizn': did you mean 'horizon'?"),
        ({"horizon": -1}, "horizon=-1.0 must be a finite number greater than 0"),
        ({"horizon": "x"}, "horizon.value: Input should be a valid number"),
        ({"control_period": 0.0}, "control_period=0.0 must be a finite number greater than 0"),
        ({"force_limit": 0.0}, "force_limit=0.0 must be a finite number greater than 0"),
        ({"uncertainty": (1.5,)}, "uncertainty.value.0: Input should be less than 1 (given 1.5)"),
        ({"initial_states": {"average": (0, 0, 0, 0)}}, "initial_states: 'average' is the name of another row"),
        ({"environment": "twins:Own-v0"}, "environment: a file may not name a module"),
    ],
)
def test_what_is_not_allowed_is_refused_as_in_a_file(change, message):
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        scenario.named("regulation").changed(**change)
    assert "\n" not in str(refused.value)
