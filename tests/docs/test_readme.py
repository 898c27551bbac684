"""The README's Python examples run as they stand."""

import re

import pytest
from conftest import ROOT

README = ROOT / "README.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_example_runs(example, capsys):
    exec(compile(example, str(README), "exec"), {})


def test_there_are_examples():
    assert len(EXAMPLES) >= 2
