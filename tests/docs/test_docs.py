"""The documentation: examples print what it says, equations are where it says, and it builds without a warning."""

import importlib
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from conftest import ROOT

DOCS = ROOT / "docs"
EXECUTED = sorted(
    path.relative_to(DOCS).as_posix()
    for path in (DOCS / "tutorial.md", *DOCS.glob("how-to/*.md"), *DOCS.glob("for/*.md"))
)
OFFLINE = {"NO_MKDOCS_2_WARNING": "1", "http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
MADE = {Path("report.html"), *(Path("notebooks") / f"{path.stem}.md" for path in ROOT.glob("notebooks/*.ipynb"))}
EXTERNAL = {
    "https://github.com/SensorsINI/CartPoleSimulation",
    "https://github.com/decargroup/closed_loop_koopman",
    "https://squidfunk.github.io/mkdocs-material/",
    "https://rl-baselines3-zoo.readthedocs.io",
}
SECTIONS = (
    "action-space",
    "observation-space",
    "rewards",
    "starting-state",
    "episode-end",
    "sensors-actuators-friction-disturbances",
    "arguments",
    "version-history",
)
BLOCK = re.compile(r'^```(\w+)(?: title="(.+?)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


@pytest.mark.usefixtures("registry")
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
            found = getattr(found, name)
        found = getattr(found, "py_func", found)  # what is compiled
        source = Path(module.__file__).read_text(encoding="utf-8")
        below = re.search(rf'^    {parts[-1]}: .*\n    """(.*?)"""', source, re.MULTILINE)
        return below[1] if below else found.__doc__
    raise AssertionError(f"{path} does not exist")


@pytest.mark.parametrize(("path", "numbers"), HOLDS.findall(MATHEMATICS))
def test_equations_are_where_the_page_says(path, numbers):
    assert expanded(numbers) <= expanded(docstring(path))


def test_every_equation_has_its_code():
    tagged = set(map(int, re.findall(r"\\tag\{(\d+)\}", MATHEMATICS)))
    assert tagged
    assert tagged <= expanded(" ".join(numbers for _, numbers in HOLDS.findall(MATHEMATICS)))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site."""
    for package in ("mkdocs", "material", "mkdocstrings_handlers.python", "latex2mathml"):
        pytest.importorskip(package, reason='the site needs pip install "smo_gym[docs]"')
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=os.environ | OFFLINE)
    assert built.returncode == 0, built.stderr
    assert "WARNING" not in built.stderr
    return folder


def pages(site):
    return {path.relative_to(site).as_posix(): path.read_text(encoding="utf-8") for path in site.rglob("*.html")}


@pytest.mark.slow
def test_site_loads_nothing_from_elsewhere_and_names_no_folder_of_the_machine(site):
    for page, text in pages(site).items():
        assert not re.search(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"?(?:https?:)?//", text), page
        for folder in (ROOT, Path.home(), site):
            assert str(folder) not in text, page


@pytest.mark.slow
def test_external_links_are_few(site):
    found = {link for text in pages(site).values() for link in re.findall(r'href="(https?://[^"]+)"', text)}
    assert found == EXTERNAL


@pytest.mark.slow
def test_formulas_are_rendered(site):
    text = pages(site)["mathematics.html"]
    assert text.count("<math ") == MATHEMATICS.count("$$") // 2 + len(re.findall(r"\\\(", MATHEMATICS))
    assert not re.search(r"arithmatex|<m[a-z]+>\\", text)
    for number in re.findall(r"\\tag\{(\d+)\}", MATHEMATICS):
        assert f'id="eq-{number}"' in text


@pytest.mark.slow
def test_generated_pages_say_what_the_code_does(site):
    built = pages(site)
    for command in ROOT.glob("agents/*.py"):
        assert f"usage: smo-gym {command.stem}" in built["commands.html"]
    for page, bound in {"pendulum": None, "upright": "1.5708", "tracking": "the shipped reference"}.items():
        text = built[f"environments/{page}.html"]
        for section in SECTIONS:
            assert f'id="{section}"' in text, f"{page} has no {section}"
        assert bound is None or bound in text
    for setting in ("controllers.smc.epsilon", "designed.operating_set.speed", "reference.elements"):
        assert setting in built["reproduction.html"].replace("<wbr>", "")
    assert "133 of 138 printed numbers" in built["reproduction.html"]


@pytest.mark.slow
def test_every_module_is_in_the_reference(site):
    reference = "".join(text for page, text in pages(site).items() if page.startswith("api/"))
    for path in (ROOT / "smo_gym").rglob("[!_]*.py"):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        assert f'id="{module}"' in reference, module


def test_relative_links_lead_somewhere():
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"\]\(([^)\s#]+?)(?:#[^)\s]*)?\)", page.read_text(encoding="utf-8")):
            led = (page.parent / target).resolve()
            made = led.relative_to(DOCS) in MADE if led.is_relative_to(DOCS) else False
            assert target.startswith("https://") or led.exists() or made, f"{page}: {target}"


def test_every_licence_goes_with_the_package():
    globs = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["license-files"]
    named = {path.relative_to(ROOT) for glob in globs for path in ROOT.glob(glob)}
    assert named == {Path("LICENSE"), Path("docs/fonts/LICENSE.txt")}
