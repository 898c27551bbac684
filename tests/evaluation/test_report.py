"""The report: one file that shows what was measured, without a browser and in one."""

import dataclasses
import json
import math
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from smo_gym import files
from smo_gym.cli.evaluate import main
from smo_gym.evaluation import scenario, statistics, study
from smo_gym.evaluation.report import page as report
from smo_gym.evaluation.report import page_numbers, page_traces, tables

EVIL = """</script><img src=x onerror="window.hacked = 1">&amp;"""


def load(name, **changes):
    return scenario.named(name).changed(note=EVIL, **({"control_period": 0.01} | changes))


def page_of(scenarios, controllers, runs=3):
    outcomes = study.measure(study.groups(scenarios, controllers, ["without", "with"], runs), seed=0, samples=100)
    results = statistics.results(outcomes)
    return outcomes, results, report.render(outcomes, results, f"python '{EVIL}'", {"smo_gym": "1.2.3"})


@pytest.fixture(scope="module")
def page():
    """Regulation with a track that one arm leaves, and tracking."""
    regulation = load("regulation", horizon=5.0, uncertainty=(0.05, 0.2), track_limit=1.65)
    tracking = load("tracking", uncertainty=(0.2,))
    evil = regulation.changed(title=EVIL, controllers={EVIL: regulation.controllers["lqr"]})
    return page_of([evil, tracking], [EVIL, "smc"])


class Page(HTMLParser):
    """What a page loads, the text of its table rows, and its JSON."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.rows, self.scripts, self._script, self._cell = [], [], {}, None, False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append((tag, attributes))
        if tag == "script":
            self._script = attributes.get("id", "")
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
            self._cell = True

    def handle_endtag(self, tag):
        self._script = None if tag == "script" else self._script
        self._cell = self._cell and tag not in ("td", "th")

    def handle_data(self, data):
        if self._script is not None:
            self.scripts[self._script] = data
        elif self._cell:
            self.rows[-1][-1] += data.strip()


def test_nothing_is_loaded_from_elsewhere(page):
    parsed = Page(page[2])
    loaded = [value for _, attributes in parsed.tags for key, value in attributes.items() if key in ("src", "href")]
    assert loaded
    assert all(value == "data:," or value.startswith("#") for value in loaded)
    style = page[2][page[2].index("<style>") : page[2].index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    assert len(page[2].encode()) < 3e6


def test_what_the_user_wrote_is_text(page):
    assert "<img" not in page[2]
    parsed = Page(page[2])
    assert "img" not in {tag for tag, _ in parsed.tags}
    assert json.loads(parsed.scripts["data"])["groups"][0]["title"] == EVIL
    assert any(EVIL in cell for row in parsed.rows for cell in row)  # a note in the settings


def test_every_cell_is_a_row_with_its_numbers(page):
    _, results, text = page
    rows = Page(text).rows
    for result in results:
        row = tables.reduction_row if result.cell.metric == tables.REDUCTION else tables.cell_row
        expected = list(row(result))
        if result.cell.metric != tables.REDUCTION:
            ratio = expected.pop(7)
            found = [shown for shown in rows if shown[:7] == expected[:7]]
            assert any(ratio in shown[7] and shown[9] == expected[7] for shown in found), result
        else:
            assert expected in rows


def test_the_page_begins_with_what_the_compensation_does(page):
    outcomes, results, text = page
    effects = page_numbers.effects(outcomes, results)
    assert [(effect.table, effect.over) for effect in effects] == [("4", "average"), ("7", "average")]
    for effect, (_, rows) in zip(effects, tables.by_table(results).items(), strict=True):
        averages = [r for r in rows if r.cell.is_average and r.cell.metric == tables.REDUCTION]
        for number, result in zip(effect.numbers, averages, strict=False):
            assert number.text == f"{result.measured:.1f} %".replace("-", "−")
            assert number.text in text
    assert [number.beside for number in effects[1].numbers[:2]] == ["93.5 % published", "24.2 % published"]
    tracking = [o for o in outcomes if o.group.scenario.table == "7" and o.group.uncertainty > 0.0]
    without, compensated = (o.metrics["effort"].mean() for o in tracking)
    assert effects[1].numbers[2].text == f"{without:,.0f} → {compensated:,.0f}"
    assert text.index("What the compensation does") < text.index("The score") < text.index("Watch a run</h2>")


def test_one_arm_begins_with_its_errors():
    groups = study.groups([load("regulation", horizon=0.1, uncertainty=(0.05,))], ["lqr"], ["oracle"], 2)
    outcomes = study.measure(groups, seed=0, samples=10)
    results = statistics.results(outcomes)
    [effect] = page_numbers.effects(outcomes, results)
    assert effect.numbers[0].name == "MSE of h, true state"
    assert [number.beside for number in effect.numbers] == ["nothing published", "nothing published", ""]
    assert page_numbers.score(results) is None
    text = report.render(outcomes, results, "", {"smo_gym": "1.2.3"})
    assert "What was measured" in text
    assert "The score" not in text


def test_the_score_counts_cells_beside_the_ceiling(page):
    score = page_numbers.score(page[1])
    assert f"{score.cells} published MSE cells in all: {score.near} within 10 %" in tables.summary(page[1])
    assert math.isnan(score.ceiling)  # from three runs
    assert "takes more than ten runs" in page[2]
    sure = [dataclasses.replace(result, ceiling=0.5) for result in page[1]]
    assert page_numbers.score(sure).ceiling == 0.5 * score.cells


def test_a_published_cell_in_which_no_run_stands_is_missed(page):
    results = page[1]
    first = tables.compared(results)[0]
    fallen = dataclasses.replace(first, measured=math.nan, ci_low=math.nan, ci_high=math.nan, half_width=math.nan)
    with_it = [fallen if result is first else result for result in results]
    score, before = page_numbers.score(with_it), page_numbers.score(results)
    assert (score.cells, score.near) == (before.cells, before.near - tables.within(first))
    assert tables.summary(with_it).startswith(f"{before.cells} published MSE cells in all: {score.near} within 10 %")
    assert tables.summary(with_it).endswith(" In 1 no run stands, so missed.")
    assert tables.verdict([fallen]).startswith("1 published MSE cells: no run stands. ")
    assert math.isnan(page_numbers.score([fallen]).ceiling)


@pytest.mark.parametrize("value", [-0.04, -0.0])
def test_nothing_is_minus_zero(value):
    assert page_numbers._percent(value) == "0.0 %"


def test_diagnostics_are_a_table_for_each_controller_and_a_column_for_each_arm(page):
    header, rows = tables.diagnosed(page[0])
    blocks = report._diagnosed(page[0])
    assert [block["arms"] for block in blocks] == [("without", "with")] * 2
    efforts = [[float(text.replace(",", "")) for text in dict(block["rows"])["effort, N² s"]] for block in blocks]
    column = header.index("effort, N^2 s")
    assert np.ravel(efforts).tolist() == [float(row[column]) for row in rows]


def test_settings_stand_with_their_sources(page):
    rows = [row for row in Page(page[2]).rows if len(row) == 5]
    assert ["plant.gravity", "-9.8", "printed", "4, 7", "m/s²; g; Table 2"] in rows
    assert ["controllers.smc.Z0", "26", "printed", "7", "Table 6"] in rows
    assert ["uncertainty", "[0.05, 0.2]", "chosen", "4", EVIL] in rows
    assert any(row[0] == "controllers.smc.k" and row[2] == "identified" for row in rows)


def test_marks_are_ratios_on_a_logarithmic_axis(page):
    results = [r for r in page[1] if math.isfinite(r.deviation)]
    assert results
    for result in results:
        mark, ratio = report._mark(result), math.exp(result.deviation)
        assert mark["middle"] == pytest.approx(np.clip(50 + 50 * math.log2(ratio), 0, 100), abs=0.1)
        assert mark["low"] <= mark["middle"] <= mark["high"]
        assert mark["sign"] == ("" if 0.9 <= ratio <= 1.1 else "▲" if ratio > 1 else "▼")


def test_few_enough_runs_are_kept(page, monkeypatch):
    assert page_traces.runs_that_fit(page[0]) == 3
    full = sum(11 * len(o.traces.time) * o.traces.u.shape[1] for o in page[0])
    monkeypatch.setattr(page_traces, "MOST_VALUES", full - 1)
    assert page_traces.runs_that_fit(page[0]) == 2
    monkeypatch.setattr(page_traces, "MOST_VALUES", 1)
    assert page_traces.runs_that_fit(page[0]) == 1


@pytest.fixture
def evaluate():
    """The command's function."""
    return lambda *arguments: main(list(map(str, arguments)))


def short(tmp_path):
    config = tmp_path / "short.yaml"
    config.write_text("extends: regulation\nhorizon: {value: 0.1, source: chosen}\n")
    return ["--config", config, "--controller", "lqr", "--runs", "2", "--out", tmp_path / "out"]


def test_the_command_writes_a_report_beside_figures(evaluate, tmp_path, capsys):
    path = tmp_path / "new" / "report.html"
    assert evaluate(*short(tmp_path), "--figures", "--report", path) == 0
    assert str(path) in capsys.readouterr().out
    assert f"--figures --report {path}" in path.read_text()
    assert any((tmp_path / "out" / "figures").iterdir())


def test_what_cannot_be_reported_is_said_before_any_run(evaluate, tmp_path, capsys, monkeypatch):
    arguments = [*short(tmp_path), "--report"]
    assert evaluate(*arguments, tmp_path) == 2
    assert "is a folder" in capsys.readouterr().err
    assert evaluate(*arguments, tmp_path / "short.yaml" / "report.html") == 2
    assert f"--report {tmp_path / 'short.yaml'}: cannot be written to" in capsys.readouterr().err
    for own in ("results.csv", "new/../settings.yaml", "figures/figure-03-states-lqr.pdf"):
        path = tmp_path / "out" / own
        assert evaluate(*arguments, path, "--figures") == 2
        assert f"--report {path}: is one of the results in --out {tmp_path / 'out'}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    monkeypatch.setitem(sys.modules, "plotly", None)
    assert evaluate(*arguments, tmp_path / "report.html") == 2
    assert 'a report needs plotly: pip install "smo_gym[report]"' in capsys.readouterr().err
    monkeypatch.undo()
    assert not (tmp_path / "out").exists()
    with pytest.raises(ValueError, match="no runs to draw"):
        report.check([], tmp_path / "report.html")


def test_an_interruption_leaves_the_old_report(evaluate, tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    arguments = [*short(tmp_path), "--report", path]
    assert evaluate(*arguments) == 0
    old = path.read_text()
    assert old.startswith("<!doctype html>")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(report, "render", interrupted)
    assert evaluate(*arguments) == 130
    monkeypatch.setattr(files.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        files.write(path, "new")
    assert path.read_text() == old
    assert {path.name for path in tmp_path.iterdir()} == {"short.yaml", "report.html", "out"}
