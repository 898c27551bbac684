"""The documentation: its examples print what they say, its equations are where it says, and it builds without a warning."""

import importlib
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import smo_gym

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
EXECUTED = sorted(path.relative_to(DOCS).as_posix() for path in (DOCS / "tutorial.md", *DOCS.glob("how-to/*.md")))
BLOCK = re.compile(r'^```(\w+)(?: title="(.+?)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", EXECUTED)
def test_examples_print_what_the_page_says(page, tmp_path, monkeypatch, capsys):
    for folder in ("agents", "configs"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    namespace = {}
    for kind, title, code in BLOCK.findall((DOCS / page).read_text(encoding="utf-8")):
        if title:
            Path(title).write_text(code, encoding="utf-8")
        elif kind == "python":
            capsys.readouterr()
            exec(compile(code, page, "exec"), namespace)
            printed = capsys.readouterr().out
        elif kind == "text":
            assert printed == code
        elif kind == "sh":
            for line in code.splitlines():
                run(line, monkeypatch)


def run(line, monkeypatch):
    """A command of this repository in this process; installing is not for tests."""
    _, python, command = line.partition("python agents/")
    if python:
        argv = shlex.split(f"agents/{command}")
        monkeypatch.setattr(sys, "argv", argv)
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(argv[0], run_name="__main__")
        assert ended.value.code == 0, line


MATHEMATICS = (DOCS / "mathematics.md").read_text(encoding="utf-8")
HOLDS = re.compile(r"\[`[\w.]+`\]\[(smo_gym[\w.]+)\] ((?:\(\d+\)(?:-\(\d+\))?(?:, )?)+)")


def expanded(text):
    """The equation numbers of a text, ranges spelt out."""
    numbers = set()
    for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", text):
        numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def docstring(path):
    """Of a module, a class or function, or of an attribute, which stands below it."""
    parts = path.split(".")
    for n in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:n]))
        except ModuleNotFoundError:
            continue
        module = found
        for name in parts[n:]:
            found, owner = getattr(found, name), found
        found = getattr(found, "py_func", found)  # what is compiled
        if isinstance(owner, type) if parts[n:] else False:
            source = Path(module.__file__).read_text(encoding="utf-8")
            below = re.search(rf'^    {parts[-1]}: .*\n    """(.*?)"""', source, re.MULTILINE)
            return below[1] if below else found.__doc__
        return found.__doc__
    raise AssertionError(f"{path} does not exist")


@pytest.mark.parametrize(("path", "numbers"), HOLDS.findall(MATHEMATICS))
def test_equations_are_where_the_page_says(path, numbers):
    assert expanded(numbers) <= expanded(docstring(path))


def test_every_equation_has_its_code():
    tagged = set(map(int, re.findall(r"\\tag\{(\d+)\}", MATHEMATICS)))
    assert tagged and tagged <= expanded(" ".join(numbers for _, numbers in HOLDS.findall(MATHEMATICS)))


def test_relative_links_lead_somewhere():
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"\]\(([^)\s#]+?)(?:#[^)\s]*)?\)", page.read_text(encoding="utf-8")):
            assert target.startswith("https://") or (page.parent / target).exists(), f"{page}: {target}"
