"""YAML that is more than settings are: one line each, at once; and numbers that look like numbers."""

import time

import pytest

from smo_gym import files
from smo_gym.evaluation import arms, configs, scenario, study

REGULATION = "extends: regulation\n"
BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


def refused(path, text, load=files.read_yaml):
    """The message."""
    path.write_text(text)
    began = time.perf_counter()
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        load(path)
    assert time.perf_counter() - began < 10.0
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 2500 + len(str(path))
    return message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "more than 20,000 values"),
        ("x: &x " + "y" * 900_000 + "\nz: [*x, *x, *x]", "or too long ones"),
        ("a: &a [*a]", "*a stands for what it is inside of"),
        ("a: " + "[" * 1000 + "]" * 1000, "nested more than 32 levels deep"),
        ("- " * 1000 + "a", "nested more than 32 levels deep"),
        ("{" * 100_000, "nested more than 32 levels deep"),
        ("a: 1\nb: {c: 1, c: 2}", "line 2: the key 'c' is given twice"),
        ("a: 1\n'a': 2", "line 2: the key 'a' is given twice"),
        ("a: .nan", "line 1: '.nan' is no finite number"),
        ("a: -.inf", "is no finite number"),
        ("a: 1e999", "'1e999' is no finite number"),
        ("a: " + "9" * 1000, "is no finite number"),
        ("a: " + "9" * 5000, "is not YAML"),
        ("a: [" + "0.1," * 200_000 + "]", "more than 20,000 values"),
        ("a: " + "x" * 1_000_001, "more than 1,000,000 characters"),
        ("a: !!bool maybe", "is not YAML"),
        ("a: !!int ''", "is not YAML"),
        ("a: !!timestamp x", "is not YAML"),
        ("a: !!python/name:os.system ''", "is not YAML"),
        ("a: *" + "q" * 5000, "is not YAML"),
        ("a: [", "is not YAML"),
    ],
)
def test_what_no_settings_are_is_said_in_a_line(tmp_path, text, message):
    assert message in refused(tmp_path / "a.yaml", text)


def test_numbers_are_those_of_yaml_1_2(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("[3e-4, 1e6, -1.5E+3, .5, 1., 12, 1_000, 0x1F, lin_3e-4, 1:30, '3e-4', ~, true]")
    found = [0.0003, 1e6, -1500.0, 0.5, 1.0, 12, 1000, 31, "lin_3e-4", "1:30", "3e-4", None, True]
    assert files.read_yaml(path) == found
    assert [type(value) for value in files.read_yaml(path)] == [type(value) for value in found]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("horizon: {value: 1e6, source: chosen}", "horizon.value: Input should be less than or equal to 100000"),
        ("control_period: {value: 1e6, source: chosen}", "control_period.value: Input should be less than"),
        ('initial_states: {value: {"": [1e12, 0, 0, 0]}, source: chosen}', "less than or equal to 10000"),
        ('horizon: {value: "nan", source: chosen}', "horizon.value: Input should be a finite number"),
        (f"title: {'x' * 100_000}", "title: String should have at most 200 characters (given 'xxx"),
        (f"environment: {'x' * 150}", "xxx"),
        (f"{'x' * 1000}: 1", "unknown setting 'xxx"),
        (f"{'x' * 100_000}: 1", "is not YAML"),
        ("".join(f"x{i}: 1\n" for i in range(5000)), "and 4,995 more"),
        (f"controllers: {{lqr: {{law: {'x' * 100_000}}}}}", "does not match"),
        ("initial_states: {value: {average: [0, 0, 0, 0]}, source: chosen}", "'average' is the name of another row"),
        (
            "initial_states: {value: {'1': [0, 0, 0, 0], a: [0, 0, 0, 0]}, source: chosen}",
            "all or none must be numbers",
        ),
        ("initial_states: {value: {a: [0, 0, 0, 0], A: [0, 0, 0, 0]}, source: chosen}", "two look the same"),
        ("designed: {slopes: {value: [1e12, 1e12], source: chosen}}", "take smaller ones"),
        ("designed: {force: {value: 1e250, source: chosen}}", "force"),
        (
            "controllers: {lqr: {observer: {step: {value: 1e-12, source: chosen}}}}",
            "controllers.lqr.lqr.observer.step.value: Input should be greater than or equal to 0.000001",
        ),
    ],
)
def test_scenarios_of_absurd_sizes_are_refused_at_once(tmp_path, text, message):
    assert message in refused(tmp_path / "a.yaml", REGULATION + text, scenario.load)


def test_a_copied_scenario_says_where_it_looks_for_the_other_file(tmp_path):
    text = configs.path("regulation").read_text(encoding="utf-8")
    assert "extends='article.yaml' is no file: it must be named" in refused(tmp_path / "a.yaml", text, scenario.load)


def test_a_chain_of_files_has_an_end(tmp_path):
    for i in range(30):
        (tmp_path / f"{i}.yaml").write_text(f"extends: {i + 1}.yaml\n")
    (tmp_path / "30.yaml").write_text(REGULATION)
    with pytest.raises(ValueError, match="of 16 at most"):
        scenario.load(tmp_path / "0.yaml")


def test_more_runs_than_can_be_done_are_refused_at_once():
    table4 = scenario.named("regulation")
    for runs in (10**6, 10**12, 10**400):
        with pytest.raises(ValueError, match=r"runs=.* take fewer runs, levels or initial states"):
            study.groups([table4], ["lqr"], arms.ARMS, runs)
