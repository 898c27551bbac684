"""Shared helpers."""

import runpy
import shutil
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest

import smo_gym  # noqa: F401  registers the environments
from smo_gym.evaluation import scenario
from smo_gym.evaluation.arms import ARMS
from smo_gym.evaluation.metrics import METERS

ROOT = Path(__file__).resolve().parents[1]
CONFIGS = ROOT / "configs"
SMALL = ROOT / "tests" / "evaluation" / "small.yaml"
IDS = ("SMOPendulum-v0", "SMOPendulumUpright-v0", "SMOPendulumTracking-v0")


@pytest.fixture(params=IDS)
def env_id(request):
    return request.param


@pytest.fixture(autouse=True)
def _registries():
    """What a test, or a page that a test runs, has registered is forgotten after it."""
    before = [(known, dict(known)) for known in (ARMS, METERS)]
    yield
    for known, was in before:
        known.clear()
        known.update(was)


@pytest.fixture
def registry():
    """The arms, which are left as they were."""
    return ARMS


@pytest.fixture(scope="module")
def browser():
    """A real browser, headless: Debian's chromium, driven by Playwright."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        pytest.skip("no chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def command(capsys, monkeypatch):
    """Runs a command in this process: what it answers, prints and complains of."""

    def run(name, *arguments, cwd=None, check=True):
        if cwd:
            monkeypatch.chdir(cwd)
        capsys.readouterr()
        code = runpy.run_path(str(ROOT / "agents" / f"{name}.py"))["main"]([*map(str, arguments)])
        shown = capsys.readouterr()
        assert not check or code == 0, shown.err
        return SimpleNamespace(returncode=code, stdout=shown.out, stderr=shown.err)

    return run


@pytest.fixture
def make_vec():
    """A native vector environment."""

    def make(n, id="SMOPendulum-v0", **options):
        return gymnasium.make_vec(id, n, vectorization_mode="vector_entry_point", **options)

    return make


@pytest.fixture
def small():
    """The smallest scenario."""
    return scenario.load(SMALL)


def assert_same(a, b, path="info"):
    """Equal to the bit, through nested dictionaries."""
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            assert_same(a[key], b[key], f"{path}[{key!r}]")
    elif isinstance(a, np.ndarray) and a.dtype == object:
        for x, y in zip(a, b, strict=True):
            assert (x is None) == (y is None), path
            assert x is None or np.array_equal(x, y), path
    else:
        assert np.array_equal(a, b), path
