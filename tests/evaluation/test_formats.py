"""Text put into a format stays text, and a column of numbers holds numbers."""

import csv
import io
import pickle
import re

import numpy as np
import pytest
import yaml
from conftest import SMALL
from test_report import Page

from smo_gym.evaluation import formats, scenario, statistics, study
from smo_gym.evaluation.report import page, tables

NAMES = [
    "=1+1",
    "@SUM(A1)",
    "-x",
    "+x",
    "\t=1",
    "a|b*c*_d_`e`",
    "[x](http://e.org)",
    "<b>&amp;",
    "50 % of $1 #2 ~ ^ {x} \\y",
    "two\nlines\r\nand\x1b[31m \u2028more",
    "\udcff.safetensors",
]


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Outcomes of one scenario whose table, controller and cases have such names."""
    data = yaml.safe_load(SMALL.read_text())
    data["horizon"]["value"] = 0.05
    data["initial_states"]["value"] = {name: [1.0, 1.0, 0.1, 0.01] for name in NAMES[:-1]}
    path = tmp_path_factory.mktemp("names") / "names.yaml"
    path.write_text(yaml.safe_dump(data))
    place = scenario.load(path)
    laws = dict.fromkeys(NAMES, place.controllers["lqr"])
    place = place.model_copy(update={"controllers": laws, "table": NAMES[5], "title": NAMES[-2]})
    return study.measure(study.groups([place], NAMES, ["without", "with"], 2), seed=0, samples=5)


def by_polars(text):
    """The table as a reader with its defaults has it, or its number of lines where there is none."""
    try:
        import polars
    except ImportError:
        return text.splitlines()[1:]
    return polars.read_csv(io.StringIO(text))


def kinds(text):
    """Of each column: numbers, text, or both."""
    header, *rows = csv.reader(io.StringIO(text))
    assert all(len(row) == len(header) for row in rows)
    return {
        name: {"number" if formats.is_number(value) else "text" for value in column if value}
        for name, column in zip(header, zip(*rows, strict=True), strict=True)
    }


def test_every_column_of_every_csv_is_of_one_kind(measured):
    texts = {"table", "controller", "case", "arm", "metric", "state", "compensation", "row"}
    for text in (tables.results_csv(statistics.results(measured)), tables.runs_csv(measured)):
        for name, found in kinds(text).items():
            assert found <= ({"text"} if name in texts else {"number"}), name
        assert len(by_polars(text)) == text.count("\n") - 1


def test_whole_numbers_among_others_get_their_point():
    rows = [["a", "5"]] * 300 + [["a", "22.5"]]
    text = formats.as_csv(["name", "level"], rows)
    assert text.splitlines()[1] == "a,5.0"
    assert len(by_polars(text)) == 301
    assert formats.as_csv(["name", "level"], rows[:-1]).splitlines()[1] == "a,5"


def test_a_spreadsheet_runs_no_formula(measured):
    for text in (tables.results_csv(statistics.results(measured)), tables.runs_csv(measured)):
        for row in csv.reader(io.StringIO(text)):
            assert not any(value[:1] in tuple("=+-@\t\r") and not formats.is_number(value) for value in row if value)
    assert formats.as_csv(["a"], [["-0.5"], ["=1"]]) == "a\n-0.5\n'=1\n"


def test_latex_keeps_every_line_whole(measured):
    text = tables.render(statistics.results(measured), "latex_booktabs", rms=False)
    assert not re.search(r"(?<!\\)[%$#]", text)
    assert text.count(r"\section*{") == len(NAMES)
    for begin, end in (("{", "}"), (r"\begin", r"\end")):
        plain = text.replace(r"\{", "").replace(r"\}", "")
        assert plain.count(begin) == plain.count(end)
    assert re.search(r"\d+ of \d+ runs failed\.", text)


def test_matplotlib_draws_names_as_they_are():
    matplotlib = pytest.importorskip("matplotlib.figure")
    figure = matplotlib.Figure()
    for name in [*NAMES, "$\\nothing$"]:
        figure.text(0.0, 0.0, formats.mathtext(name))
    figure.canvas.draw()


def test_markdown_shows_names_as_they_are(measured):
    text = tables.render(statistics.results(measured), "github", rms=False)
    assert r"## Table a\|b\*c\*\_d\_\`e\`, =1+1" in text
    assert r"[x\](http://e.org)" in text
    assert r"\<b\>\&amp;" in text
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in block.splitlines()}) == 1


@pytest.mark.parametrize("form", ["simple", "github", "latex_booktabs"])
def test_a_name_with_line_breaks_is_on_one_line(measured, form):
    text = tables.render(statistics.results(measured), form, rms=False) + tables.diagnostics(measured, form)
    assert formats.escaped("two lines and [31m more", form) in text
    assert "\x1b" not in text
    text.encode()


def test_the_report_names_controllers_as_the_tables_do(measured):
    results = statistics.results(measured)
    text = page.render(measured, results, "python", {"smo_gym": "1.2.3"})
    text.encode()
    shown = [row[0] for row in Page(text).rows if row and row[0].startswith("Table ")]
    for name in NAMES:
        assert any(tables.title(name) in heading for heading in shown), name
    assert tables.title("twins:Twin") == "twins:Twin"
    assert tables.title("runs/a.safetensors-tracking") == "runs/a.safetensors-tracking"
    assert tables.title("smc-tracking") == "SMC-TRACKING"
    assert "toUpperCase" not in text
    assert re.search(r"text-transform: *uppercase", text) is None or "kicker" in text


def test_the_charts_buttons_are_these(measured):
    """Plotly's own set would have one that uploads the figure to its makers."""
    text = page.render(measured, statistics.results(measured), "python", {"smo_gym": "1.2.3"})
    (buttons,) = re.findall(r"const BUTTONS = (\[.*\]);", text)
    assert re.findall(r"\w+", buttons) == ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]
    (config,) = re.findall(r"Plotly\.(?:react|newPlot)\(.*?(\{.*\})\)", text)
    assert "modeBarButtons: BUTTONS" in config
    assert 'plotlyServerURL: ""' in config


def test_a_scenario_and_its_runs_can_be_pickled(measured):
    group = measured[0].group
    for original in (group.scenario, group):
        again = pickle.loads(pickle.dumps(original))
        assert again == original
        assert repr(again) == repr(original)
    again = pickle.loads(pickle.dumps(measured[0]))
    assert again.group == group
    for name, values in measured[0].metrics.items():
        assert np.array_equal(again.metrics[name], values, equal_nan=True)
    assert again.group.scenario.model_dump() == group.scenario.model_dump()


def test_an_unknown_arm_is_named(measured):
    place = measured[0].group.scenario
    with pytest.raises(ValueError, match="unknown arm 'orcale': did you mean 'oracle'"):
        study.groups([place], ["=1+1"], ["with", "orcale"], 1)
    with pytest.raises(ValueError, match="unknown arm 'off'"):
        study.Group(place, "=1+1", 0.1, "", "off", 1)
