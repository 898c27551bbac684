"""Tables that sort, as one HTML file: what is in it, and in a real browser."""

from html.parser import HTMLParser

import pytest
from matplotlib.text import Text

from smo_gym.cli.arguments import versions
from smo_gym.evaluation import candidates
from smo_gym.evaluation.observing import Row
from smo_gym.evaluation.report import observer_panels, table_page
from smo_gym.evaluation.report.table_page import Origin, Table

EVIL = "<script>alert(1)</script>"
ERRORS = {"ekf": "0.01 / 2", "smo-tuned": "3e-07", "luenberger": "10 (2 lost)", EVIL: "-", "ukf": "0.5"}
VOID = {"meta", "link", "br", "input"}
"""Elements that have no end."""


def row(observer, sensor, **numbers):
    given = {"uncertainty": 0.2, "loop": "open", "channel": "theta_dot", "runs": 2, "failed": 0, "rmse": 1.0}
    return Row(sensor, observer=observer, ci_low=0.9, ci_high=1.1, **{**given, **numbers})


def page():
    named = ("ekf", "ukf", "smo-tuned")
    rows = [
        row(name, sensor, channel=channel, lag_ms=1.0 + i, noise_gain=9.0 - i)
        for i, name in enumerate(named)
        for sensor in ("exact", "noise")
        for channel in ("h_dot", "theta_dot")
    ]
    known = candidates.named("simulated").observers
    return table_page.render(
        "Observers",
        f"How it was measured, by {EVIL}",
        [Table("Open loop, theta': RMS", ("observer", "counts", "ns"), [*((n, e, 7) for n, e in ERRORS.items())])],
        {"Noise against lag": observer_panels.draw(rows, named, 0.2)},
        Origin(f"smo-gym observers {EVIL}", versions(), candidates.told({name: known[name] for name in named})),
    )


class Outline(HTMLParser):
    """The rows of the tables, all addresses, and the elements that are not closed."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.addresses, self.open = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.addresses += [value for name, value in attrs if name in ("src", "href", "xlink:href", "data")]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td") and self.rows:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if {"th", "td"} & {*self.open}:
            self.rows[-1][-1] += data


def test_a_page_holds_what_it_was_given_and_loads_nothing():
    text = page()
    seen = Outline(text)
    assert seen.open == []
    assert [cells for cells in seen.rows if cells[0] in ERRORS] == [[name, cell, "7"] for name, cell in ERRORS.items()]
    assert EVIL not in text
    assert all(address.startswith(("#", "data:")) for address in seen.addresses)
    assert ["ekf.observer", "ekf", "", ""] in seen.rows
    assert any(cells[0] == "smo-tuned.tuned" and cells[2] == "identified" for cells in seen.rows)
    assert text.count("<svg") == 1
    assert text == page()


def test_no_label_lies_on_another():
    names = ["first", "second", "third", "fourth"]
    rows = [
        row(name, sensor, channel=channel, lag_ms=20.0**i, noise_gain=1.0 + 0.02 * i)
        for i, name in enumerate(names)
        for sensor in ("exact", "noise")
        for channel in ("h_dot", "theta_dot")
    ]
    figure = observer_panels.draw(rows, names, 0.2)
    for panel in figure.axes:
        boxes = [Text.get_window_extent(label) for label in panel.texts]
        assert len(boxes) == len(names)
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


@pytest.fixture
def opened(browser, tmp_path):
    """Opens the page; at the end nothing may have gone wrong in it, or been asked for."""
    path = tmp_path / "observers.html"
    path.write_text(page())
    said, contexts = [], []

    def open_page(**options):
        contexts.append(browser.new_context(**options))
        it = contexts[-1].new_page()
        it.on("console", lambda message: said.append(message.text))
        it.on("pageerror", lambda error: said.append(str(error)))
        it.on("request", lambda asked: asked.url.startswith(("file:", "data:")) or said.append(asked.url))
        it.goto(path.as_uri())
        return it

    yield open_page
    for context in contexts:
        context.close()
    assert said == []


@pytest.mark.slow
def test_a_click_sorts_and_another_turns_it_round(opened):
    it = opened()
    names = it.locator("table.sortable tbody th")
    assert names.all_inner_texts() == [*ERRORS]
    it.get_by_role("button", name="counts").click()
    assert names.all_inner_texts() == ["smo-tuned", "ekf", "ukf", "luenberger", EVIL]
    assert it.get_attribute("th:has-text('counts')", "aria-sort") == "ascending"
    it.get_by_role("button", name="counts").click()
    assert names.all_inner_texts() == ["luenberger", "ukf", "ekf", "smo-tuned", EVIL]
    it.get_by_role("button", name="observer").click()
    assert names.all_inner_texts()[1:] == ["ekf", "luenberger", "smo-tuned", "ukf"]
    assert it.locator("[aria-sort]").all_inner_texts() == ["observer"]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_nothing_is_in_the_way_of_anyone(opened, scheme, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    it = opened(color_scheme=scheme, viewport={"width": width, "height": 900})
    it.get_by_role("button", name="ns").click()
    found = axe.Axe().run(it).response["violations"]
    assert [(fault["id"], fault["impact"]) for fault in found] == []
    assert it.evaluate("document.documentElement.scrollWidth") == width
