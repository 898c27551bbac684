"""Consoles are a hundred columns wide."""

import pytest

from smo_gym.cli import narrow


def test_a_table_that_fits_is_left_and_one_that_does_not_is_broken_between_words():
    assert narrow.table(["a", "b"], [["one word", "2"]]).splitlines()[-1].split() == ["one", "word", "2"]
    long = "word " * 30
    text = narrow.table(["first " * 12, "second"], [[long, "7,000"], ["x", "-1.5"]])
    assert max(map(len, text.splitlines())) <= 100
    assert text.count("word") == 30
    assert "7,000" in text


def test_no_line_begins_with_a_percent_sign():
    for words in range(10, 40):
        assert "\n%" not in narrow.paragraph("word " * words + "7 % of all")


@pytest.mark.parametrize("arguments", [("consistency",), ("consistency", "--all")])
def test_the_article_beside_itself_ends_with_the_answer(command, arguments):
    lines = command(*arguments).stdout.splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0].endswith("RMS in m and rad, reductions in percent.")
    assert lines[-1] == (
        "133 of 138 printed numbers follow from the printed cells, 4 as the mean of reductions, 1 by neither."
    )


def test_falls_end_with_the_answer_and_the_path(command, tmp_path):
    lines = command("upright", "--runs", "1", "--out", tmp_path).stdout.splitlines()
    assert max(map(len, lines[:-1])) <= 100
    assert "over all starts, this many fall" in "\n".join(lines)
    assert lines[-1] == f"falls.csv and falls.md are in {tmp_path}"
