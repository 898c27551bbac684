"""Every test that a page names exists; every block of every page closes and parses."""

import re
import shutil
import subprocess

import pytest
import yaml
from conftest import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
NAMED = re.findall(r"`(test_\w+\.py)::(test_\w+)`", (ROOT / "docs" / "promised.md").read_text(encoding="utf-8"))
FENCE = re.compile(r"^(```+)(\w*)(.*)$")


def blocks(text):
    """Language and lines of each block of a page; an open one is an error, as is one that begins inside another."""
    found, kind, lines = [], None, []
    for line in text.splitlines():
        fence = FENCE.match(line.strip())
        if fence and kind is None:
            kind, lines = fence[2], []
        elif fence and kind is not None:
            assert not fence[2], f"```{fence[2]} inside of a block that began with ```{kind}"
            found.append((kind, "\n".join(lines) + "\n"))
            kind = None
        elif kind is not None:
            lines.append(line)
    assert kind is None, f"```{kind} never closes"
    return found


@pytest.mark.parametrize(("file", "test"), NAMED)
def test_named_tests_exist(file, test):
    assert f"def {test}(" in next((ROOT / "tests").rglob(file)).read_text(encoding="utf-8")


def test_every_kind_of_promise_names_tests():
    assert len(NAMED) > 20


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_block_closes_and_parses(page):
    for kind, code in blocks(page.read_text(encoding="utf-8")):
        if kind == "python":
            compile(code, str(page), "exec")
        elif kind in ("yaml", "yml"):
            yaml.safe_load(code)
        elif kind in ("sh", "bash") and shutil.which("bash"):
            checked = subprocess.run(["bash", "-n"], input=code, capture_output=True, text=True, check=False)
            assert checked.returncode == 0, checked.stderr


def test_an_open_block_is_noticed():
    with pytest.raises(AssertionError, match="never closes"):
        blocks("```sh\nls\n")
    with pytest.raises(AssertionError, match="inside of a block"):
        blocks("```sh\nls\n```python\n1\n```\n")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_picture_is_there_small_and_described(page):
    for alt, target in re.findall(r"!\[(.*?)\]\((.+?)\)", page.read_text(encoding="utf-8")):
        assert len(alt) > 30, target
        assert (page.parent / target).stat().st_size < 400_000
