"""One-way streets: a module imports only from rooms that stand before its own, and there is no circle."""

import ast
import re
from graphlib import TopologicalSorter

from conftest import ROOT

ROOMS = re.findall(
    r"`(?:smo_gym/)?(\w+)(?:\.py|/)`", (ROOT / "README.md").read_text(encoding="utf-8").split("## Where things are")[1]
)


def modules():
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted((ROOT / "smo_gym").rglob("*.py"))
    }


def imported(name, path, known):
    """The modules of this package that a module imports, at the top or inside of a function."""
    here = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        base = here[: len(here) - node.level + 1] if node.level else []
        target = ".".join([*base, *([node.module] if node.module else [])])
        for alias in node.names:
            inner = f"{target}.{alias.name}"
            if inner in known:
                yield inner
            elif target in known:
                yield target


GRAPH = {name: {*imported(name, path, modules())} - {name} for name, path in modules().items()}


def room(name):
    return name.split(".")[1]


def test_the_readme_shows_every_room():
    rooms = {room(name) for name in GRAPH if name != "smo_gym"}
    assert rooms <= {*ROOMS}


def test_no_import_runs_back_up():
    back = [
        f"{name} imports {other}"
        for name, others in GRAPH.items()
        for other in others
        if "smo_gym" not in (name, other) and ROOMS.index(room(other)) > ROOMS.index(room(name))
    ]
    assert not back


def test_there_is_no_circle():
    parents = {name: {other for other in others if not name.startswith(f"{other}.")} for name, others in GRAPH.items()}
    assert len([*TopologicalSorter(parents).static_order()]) == len(GRAPH)


def test_an_import_that_runs_back_up_would_be_seen(tmp_path):
    path = tmp_path / "plant.py"
    path.write_text("def f():\n    from .evaluation import rollout\n    from . import wrappers\n")
    assert [*imported("smo_gym.plant", path, modules())] == ["smo_gym.evaluation.rollout", "smo_gym.wrappers"]
