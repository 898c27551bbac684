"""Lines of the site end where a reader wants them to."""

import runpy

import pytest
from conftest import ROOT

HOOK = runpy.run_path(str(ROOT / "docs/hooks/lines.py"))["on_page_content"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("20 % of 30 N in 5 ms", "20~% of 30~N in 5~ms"),
        ("in Table 4, LQR: 3 of 24 cells", "in Table~4,~LQR: 3~of 24 cells"),
        ("10 more, 2 steps", "10 more, 2 steps"),
        ("<code>--runs 3 s</code>, 3 s", "<code>--runs 3 s</code>, 3~s"),
    ],
)
def test_a_number_keeps_what_it_counts(text, shown):
    assert HOOK(text) == shown.replace("~", "\N{NO-BREAK SPACE}")


def test_a_long_name_breaks_between_its_words_in_tables_alone():
    name = "<code>test_it.py::test_a_b</code>"
    assert HOOK(name) == name
    assert HOOK(f"<table>{name}</table>") == "<table><code>test_it.py::<wbr>test_a<wbr>_b</code></table>"
    assert HOOK('<table><code class="a_b">a.b/c_d.py</code></table>').count("<wbr>") == 3
