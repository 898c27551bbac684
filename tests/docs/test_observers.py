"""The reference of the observers has all of them, with the errors of the page that measures them."""

import re

import pytest
from conftest import ROOT

from smo_gym.observers import OBSERVERS

PAGE = (ROOT / "docs/api/observers.md").read_text(encoding="utf-8")
MEASURED = (ROOT / "docs/observers.md").read_text(encoding="utf-8")
MODULES = sorted(path.stem for path in (ROOT / "smo_gym/observers").glob("[!_]*.py"))
ROWS = {
    cells[1].strip("`"): cells
    for line in re.findall(r"^\| (\[.+) \|$", PAGE, re.MULTILINE)
    if len(cells := line.split(" | ")) == 6
}


def test_every_module_stands_once():
    assert sorted(re.findall(r"^::: smo_gym\.observers\.(\w+)$", PAGE, re.MULTILINE)) == MODULES


def test_every_name_has_a_row():
    assert {*ROWS} == {*OBSERVERS}


@pytest.mark.parametrize(
    ("name", "row"),
    [
        ("kalman-ca", "Kalman, constant acceleration"),
        ("high-gain", "high gain and model"),
        ("luenberger", "Luenberger"),
        ("steady-kalman", "model and constant Kalman gain"),
        ("super-twisting", "super-twisting and model, implicit"),
        ("homogeneous", "third order and model"),
        ("levant", "Levant, proper"),
        ("smo", "the article's"),
        ("ekf", "extended Kalman filter"),
        ("ukf", "unscented Kalman filter"),
    ],
)
def test_its_errors_are_those_that_are_measured(name, row):
    pole = re.search(rf"^\| {re.escape(row)} \| \S+ \| \**([\d.]+)", MEASURED, re.MULTILINE)
    assert ROWS[name][4].split(";")[0] == pole[1]
