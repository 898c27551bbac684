"""Scenarios: what is wrong in a file is named."""

import pytest
from conftest import SMALL

from smo_gym.evaluation import scenario
from smo_gym.wrappers import VectorObserverWrapper


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("horizon:", "horizn:"), r"horizn: unknown setting 'horizn': did you mean 'horizon'\?"),
        (("slopes:", "slope:"), r"slope: unknown setting 'slope': did you mean 'slopes'\?"),
        (("[0.1, 0.2]", "[0.1, 1.5]"), r"uncertainty\.value\.1: .* less than 1 \(given 1\.5\)"),
        (("source: printed", "source: guessed"), r"source: .*'printed', 'identified' or 'chosen' \(given 'guessed'\)"),
        (("law: lqr", "law: pid"), r"controllers\.lqr: Input tag 'pid' found using 'law' does not match"),
        (("SMOPendulum-v0", "SMOPendulm-v0"), "Environment `SMOPendulm` doesn't exist"),
        (("SMOPendulum-v0", "Pendulum-v1"), "Pendulum"),
        (("{value: 1.0,", "{value: -1.0,"), r"horizon=-1\.0 must be a finite number greater than 0"),
        (("gains: {value: lqr", "gains: {value: lqg"), r"unknown column of Table 3 'lqg': did you mean 'lqr'\?"),
        (("[12.0, 12.0]", "[1500, 12.0]"), "too large for these gains"),
        (('{"": [1.0, 1.0, 0.1, 0.01]}', "{}"), "initial_states.value: Dictionary should have at least 1 item"),
        (
            ("law: lqr", "law: lqr\n    initial_states: {value: {far: [1, 1, 0, 0]}, source: chosen}"),
            r"controllers\.lqr\.initial_states: names 'far' must be the scenario's, ''",
        ),
        (
            ("law: lqr", "law: lqr\n    initial_states: {value: {'': [1, 1, 0]}, source: chosen}"),
            r"controllers\.lqr\.lqr\.initial_states\.value\.",
        ),
        (('table: "4"', "extends: bad.yaml"), "extends itself"),
        (('table: "4"', "extends: 5"), "extends=5 must be the name of a file"),
        (('table: "4"', ""), "table: Field required"),
        (("title: test", "title: ["), "is not YAML"),
    ],
)
def test_bad_scenarios_are_named(tmp_path, change, message):
    path = tmp_path / "bad.yaml"
    text = SMALL.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(ValueError, match=message):
        scenario.load(path)


def test_a_missing_scenario_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"none\.yaml: cannot be read \(No such file or directory\)"):
        scenario.load(tmp_path / "none.yaml")


def test_an_observer_may_start_at_what_is_measured(tmp_path):
    path = tmp_path / "measured.yaml"
    zero = "xhat0: {value: [0, 0, 0, 0]"
    assert zero in SMALL.read_text()
    path.write_text(SMALL.read_text().replace(zero, "xhat0: {value: measured"))
    place = scenario.load(path)
    (x0,) = place.initial_states.value.values()
    (settings,) = place.controllers.values()
    env = VectorObserverWrapper(place.make(), settings.observer.build(compensation=True))
    observation, _ = env.reset(options={"state": [x0]})
    assert observation[0, -4:].tolist() == [*x0[:2], 0.0, 0.0]


def test_a_start_of_an_observer_is_a_state_or_the_word(tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text(SMALL.read_text().replace("xhat0: {value: [0, 0, 0, 0]", "xhat0: {value: measurd"))
    with pytest.raises(ValueError, match=r"xhat0.*'measured' \(given 'measurd'\)"):
        scenario.load(path)
