"""What is checked before a commit and in continuous integration is there, and needs no download."""

import os
import re
import tomllib

import pytest
import yaml
from conftest import ROOT

CI = (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_hooks_before_a_commit_are_tools_of_the_environment():
    (repository,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert repository["repo"] == "local"
    dev = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["dev"]
    for hook in repository["hooks"]:
        assert hook["language"] == "system"
        tool = hook["entry"].split()[0]
        assert any(re.match(rf"{tool}\b", line) for line in dev), tool
        assert f'"$bin/{tool}"' in CI


def test_the_workflow_runs_what_everybody_can_run():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
    steps = [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]
    assert steps == ["bash .ci/run"]
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


@pytest.mark.parametrize("name", sorted({*re.findall(r"\btests/[\w/.]+", CI)}))
def test_what_continuous_integration_names_is_there(name):
    assert (ROOT / name).exists()


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "docs/reproduction.md", "docs/learning.md"])
def test_tests_that_a_page_names_are_there(page):
    for name in re.findall(r"`(tests/[\w/.]+)`", (ROOT / page).read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_the_guide_leads_somewhere():
    for target in re.findall(r"\]\(([^)]+)\)", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")):
        assert (ROOT / target).exists(), target
