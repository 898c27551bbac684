"""The report in a real browser, headless: Debian's chromium, driven by Playwright."""

import re

import numpy as np
import pytest
from test_report import EVIL, load, page_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The article's plant with runs that fail, one with a reference, the upright plant, and runs that fail at once."""
    regulation = load("regulation", horizon=5.0, uncertainty=(0.05, 0.2), track_limit=1.65)
    regulation = regulation.changed(title=EVIL, controllers={"lqr": regulation.controllers["lqr"]})
    tracking = load("tracking", uncertainty=(0.2,))
    upright = load("upright", horizon=2.0, uncertainty=(0.1,), initial_states={"near": (0.0, 0.1, 0.0, 0.0)})
    nowhere = load("regulation", horizon=1.0, uncertainty=(0.1,), track_limit=1.0)
    nowhere = nowhere.changed(table="none", controllers={"smc": nowhere.controllers["smc"]})
    outcomes, results, text = page_of([regulation, tracking, upright, nowhere], ["lqr", "smc"])
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(text)
    return outcomes, results, path


@pytest.fixture
def opened(browser, report):
    """Opens the page; at the end nothing may have gone wrong in it."""
    said, contexts = [], []

    def asked(request):
        if not request.url.startswith(("file:", "data:", "blob:")):
            said.append(request.url)

    def open_page(**options):
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", asked)
        page.goto(report[2].as_uri())
        page.wait_for_selector("html[data-ready]", state="attached")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert said == []


def choose(page, table, controller, arm="with", **more):
    page.select_option("#choice [name=table]", index=("4", "7", "upright", "none").index(table))
    for name, value in {"controller": controller, **more, "arm": arm}.items():
        page.select_option(f"#choice [name={name}]", value, force=True)


def seek(page, time):
    page.eval_on_selector("#slider", "(it, t) => { it.value = t; it.dispatchEvent(new Event('input')) }", time)


def seconds(page):
    return float(page.inner_text("#time").removesuffix(" s"))


def picture(page):
    return page.eval_on_selector("#stage", "canvas => canvas.toDataURL()")


def test_the_animation_moves_until_it_is_paused(opened):
    page = opened()
    before = picture(page)
    page.click("#play")
    page.wait_for_function("parseFloat(document.querySelector('#time').value) > 0.2")
    page.click("#play")
    stopped, moved = seconds(page), picture(page)
    assert moved != before
    page.wait_for_timeout(200)
    assert seconds(page) == stopped
    page.focus("#stage")
    page.keyboard.press("ArrowRight")
    assert seconds(page) == pytest.approx(stopped + 0.05, abs=0.011)
    page.keyboard.press("Space")
    page.wait_for_function(f"parseFloat(document.querySelector('#time').value) > {stopped + 0.2}")
    page.click("#play")
    seek(page, 2.0)
    cursor, expected = page.evaluate(
        """() => {
            const curves = document.querySelector('#curves'), axis = curves._fullLayout.xaxis;
            const left = (element) => element.getBoundingClientRect().x;
            return [left(document.querySelector('#cursor')), left(curves) + axis._offset + axis.l2p(2.0)];
        }"""
    )
    assert cursor == pytest.approx(expected, abs=1.0)
    assert page.evaluate("window.hacked") is None


def test_curves_and_readings_are_the_measured_runs(opened, report):
    page = opened()
    for table, controller in (("4", "lqr"), ("7", "smc-tracking")):
        choose(page, table, controller, uncertainty="20 %", run="3")
        wanted = (table, controller, 0.2, "with")
        groups = [(o.group.scenario.table, o.group.name, o.group.uncertainty, o.group.arm) for o in report[0]]
        outcome = report[0][groups.index(wanted)]
        traces = outcome.traces
        alive = traces.time <= outcome.metrics["duration"][2] + 1e-9
        drawn = page.evaluate("document.querySelector('#curves').data.map(one => [one.meta, [...one.y]])")
        expected = {
            "truth": traces.x[..., 2],
            "estimate": traces.xhat[..., 2],
            "error": (traces.x - traces.xhat)[..., 2],
            "reference": traces.x_d,
            "force_high": traces.u_high[:, [2]],
        }
        counts = {"truth": 2, "estimate": 2, "error": 2, "force_high": 1, "reference": 2 * (table == "7")}
        for kind, count in counts.items():
            found = [(meta.get("state", 0), y) for meta, y in drawn if meta["kind"] == kind]
            assert len(found) == count
            for state, y in found:
                values = expected[kind][alive, state]
                step = 2e-3 if kind == "force_high" else 2e-4
                np.testing.assert_allclose(y, values, atol=step * np.ptp(values) + 1e-6)
        seek(page, traces.time[10])
        readings = page.locator(".readout tbody tr").first.locator("td").all_inner_texts()
        shown = [float(text.replace("\u2212", "-")) for text in readings[:4]]
        assert not any(re.fullmatch(r"[-\u2212]0\.0*", text) for text in readings)
        np.testing.assert_allclose(shown, traces.x[10, :, 2], atol=6e-4 + 1e-4 * np.ptp(traces.x[..., 2]))


def test_the_bob_hangs_below_the_cart_or_stands_above(opened):
    page = opened()
    for table, sign in (("4", 1), ("upright", -1)):
        choose(page, table, "lqr")
        seek(page, 2.0)
        bob, cart = page.evaluate(
            """() => {
                const canvas = document.querySelector('#stage'), { width, height } = canvas, rows = [[], []];
                const copy = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
                copy.drawImage(canvas, 0, 0);
                const { data } = copy.getImageData(0, 0, width, height);
                for (let k = 0; k < data.length; k += 4) {
                    const blue = data[k] < 10 && data[k + 2] > 150; // the bob opaque, the cart translucent
                    if (blue && data[k + 3] > 0) rows[+(data[k + 3] < 255)].push(k / 4 / width);
                }
                return rows.map((some) => some.reduce((a, b) => a + b, 0) / some.length);
            }"""
        )
        assert sign * (bob - cart) > 20


def test_no_button_sends_a_figure_away(opened):
    page = opened()
    for plot in ("#curves", "#bars", "#scatter"):
        titles = page.locator(f"{plot} .modebar-btn").evaluate_all("all => all.map((one) => one.dataset.title)")
        assert len(titles) == 6
        assert not re.search("share|cloud|edit|upload", " ".join(titles), re.IGNORECASE)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
def test_nothing_is_in_the_way_of_anyone(opened, scheme, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = opened(color_scheme=scheme, viewport={"width": width, "height": 900})
    page.check("#display [name=arms]")
    page.wait_for_selector("#curves-key li:nth-child(3)")
    found = axe.Axe().run(page).response["violations"]
    assert [(fault["id"], fault["impact"]) for fault in found] == []
    assert page.evaluate("document.documentElement.scrollWidth") == width
    wide, inside = page.evaluate(
        "(({ scrollWidth, clientWidth }) => [scrollWidth, clientWidth])(document.querySelector('.diagnostics'))"
    )
    assert wide == inside


def test_a_filter_that_nothing_passes_says_so(opened):
    page = opened()
    assert not page.is_visible("#none")
    page.select_option("#filter [name=controller]", "lqr")
    page.fill("#filter [name=text]", "no such row")
    assert "No cells match" in page.inner_text("#none")
    assert not page.is_visible(".cells")
    page.click("#none button")
    page.wait_for_selector(".cells tr[data-arm]")
    assert not page.is_visible("#none")
    assert page.input_value("#filter [name=controller]") == page.input_value("#filter [name=text]") == ""


def test_a_law_is_kept_from_table_to_table(opened):
    page = opened()
    for table, controller, tracking in (("none", "smc", "smc-tracking"), ("4", "lqr", "lqr-tracking")):
        choose(page, table, controller)
        page.select_option("#choice [name=table]", index=1)
        assert page.input_value("#choice [name=controller]") == tracking


def test_space_plays_wherever_it_has_no_other_use(opened):
    page = opened()
    for place in ("body", "#slider", ".diagnostics"):
        page.eval_on_selector(place, "it => { it.focus(); if (it === document.body) document.activeElement.blur(); }")
        page.keyboard.press("Space")
        assert page.get_attribute("#play", "aria-label") == "Pause"
        page.keyboard.press("Space")
        assert page.get_attribute("#play", "aria-label") == "Play"
    page.focus("#filter [name=text]")
    page.keyboard.press("Space")
    assert page.input_value("#filter [name=text]") == " "
    page.focus("#display [name=runs]")
    page.keyboard.press("Space")
    assert page.is_checked("#display [name=runs]")
    assert page.get_attribute("#play", "aria-label") == "Play"


def test_the_first_numbers_are_those_of_the_chosen_table(opened):
    page = opened()
    chosen = page.locator(".effect:visible")
    assert chosen.count() == 1
    page.select_option("#effects-of", "Table 7, SMC-TRACKING")
    assert "Table 7, SMC-TRACKING" in chosen.inner_text()
    assert chosen.locator("strong").count() == 3


def test_filters_change_the_tables(opened, report):
    page = opened()
    cells = page.locator(".cells tr[data-arm]:visible")
    mse = [r for r in report[1] if r.cell.metric == "mse"]
    assert cells.count() == len(mse)
    page.select_option("#filter [name=controller]", "smc-tracking")
    page.select_option("#filter [name=arm]", "with")
    page.select_option("#filter [name=state]", "theta")
    assert cells.count() == 3  # 0 %, 20 % and the average
    assert all("theta" in text and "with" in text for text in cells.all_inner_texts())
    page.fill("#filter [name=text]", "Average")
    assert cells.count() == 1
    assert re.match(r"1 of \d+ rows", page.inner_text("#count"))


def test_a_row_is_watched_without_motion_by_who_wants_none(opened):
    page = opened(reduced_motion="reduce", color_scheme="dark", viewport={"width": 390, "height": 844})
    page.locator("tbody[data-controller=smc-tracking] .watch:visible").last.click()
    assert page.input_value("#choice [name=controller]") == "smc-tracking"
    page.wait_for_timeout(200)
    assert seconds(page) == 0.0
    choose(page, "none", "smc")  # ended where it began
    assert "failed at 0.01 s" in page.inner_text("#about")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
