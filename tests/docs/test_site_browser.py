"""The site in a real browser, headless: served from a folder, with nothing from elsewhere."""

import functools
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from test_docs import pages, site  # noqa: F401  (the fixture)

pytestmark = pytest.mark.slow
PHONE = {"width": 390, "height": 844}


class Silent(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        """Say nothing."""


@pytest.fixture(scope="module")
def address(site):  # noqa: F811
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Silent, directory=site)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture
def tab(browser, address):
    """A page that fails the test when anything in it goes wrong."""
    said, contexts = [], []

    def open_tab(**options):
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on(
            "request", lambda request: None if request.url.startswith((address, "data:")) else said.append(request.url)
        )
        return page

    yield open_tab
    for context in contexts:
        context.close()
    assert said == []


def test_search_finds_a_remark(tab, address):
    page = tab()
    page.goto(f"{address}/index.html")
    page.locator("input[name=query]").click()
    page.keyboard.type("Remark 3")
    page.wait_for_selector(".md-search-result__item a")
    page.goto(page.locator(".md-search-result__item a").first.evaluate("one => one.href"))
    assert "Remark 3" in page.inner_text("article")


def test_mathematics_is_drawn(tab, address):
    page = tab()
    page.goto(f"{address}/mathematics.html")
    sizes = page.locator("math").evaluate_all("all => all.map((one) => one.getBoundingClientRect().height)")
    assert len(sizes) > 50
    assert min(sizes) > 4
    fraction = page.locator("#eq-1 mfrac").first.bounding_box()
    assert fraction["height"] > 25  # a numerator above a denominator


def test_every_page_fits_a_phone_and_says_no_error(tab, address, site):  # noqa: F811
    page = tab(viewport=PHONE)
    wide = []
    for name in sorted(pages(site)):
        page.goto(f"{address}/{name}", wait_until="domcontentloaded")
        if page.evaluate("document.documentElement.scrollWidth") > PHONE["width"]:
            wide.append(name)
    assert wide == []


def test_drawings_follow_the_readers_choice_not_the_machines(tab, address):
    page = tab(color_scheme="dark")
    page.goto(f"{address}/index.html")
    colours = """() => [
        getComputedStyle(document.querySelector('.picture .line')).stroke,
        getComputedStyle(document.body).backgroundColor,
    ]"""

    def lightness(colour):
        return sum(map(int, colour[colour.index("(") + 1 : -1].split(",")[:3]))

    line, ground = map(lightness, page.evaluate(colours))
    assert line > ground + 300
    page.locator("label[for=__palette_0]:visible, label[for=__palette_1]:visible").click()
    line, ground = map(lightness, page.evaluate(colours))
    assert line < ground - 300
