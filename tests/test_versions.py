"""One version everywhere, and the versions that pyproject.toml allows are those that continuous integration tries."""

import re
import tomllib
from importlib import metadata

import yaml
from conftest import ROOT

import smo_gym
from smo_gym.cli.arguments import versions

EXTRAS = ("rl", "render", "plots", "report", "reference", "mpc", "dask", "recordings")


def test_the_lowest_versions_that_are_tried_are_the_lowest_that_are_allowed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *(line for extra in EXTRAS for line in project["optional-dependencies"][extra])]
    lowest = dict(re.match(r"([\w.-]+)>=([\w.]+)", line).groups() for line in wanted)
    del lowest["torch"]  # its CPU build is pinned
    lines = (ROOT / ".ci" / "lowest.txt").read_text().splitlines()
    tried = dict(line.split("==") for line in lines if not line.startswith("#"))

    def number(version):
        return [int(part) for part in version.removesuffix(".0").removesuffix(".0").split(".")]

    assert {name: number(v) for name, v in lowest.items()} == {name: number(v) for name, v in tried.items()}


def test_results_tell_the_version_of_the_code_that_made_them(monkeypatch):
    monkeypatch.setattr(metadata, "version", lambda name: "0.0.1")  # as of a checkout installed long ago
    assert versions()["smo_gym"] == smo_gym.__version__
    assert versions()["numpy"] == "0.0.1"


def test_the_citation_and_the_changelog_name_the_version():
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == smo_gym.__version__
    assert f"## {smo_gym.__version__} - " in (ROOT / "CHANGELOG.md").read_text()
