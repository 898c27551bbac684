"""Numbers and lists of a command line."""

import pytest
from test_nothing_lost import load

from smo_gym.cli import arguments


def test_numbers_are_read_in_one_way():
    assert [arguments.whole(0)(text) for text in ("1e6", "12", "1.5e1", "9007199254740993")] == [
        1_000_000,
        12,
        15,
        9007199254740993,
    ]
    assert [arguments.real(text) for text in ("3e-4", "-1e-3", ".5")] == [3e-4, -1e-3, 0.5]
    assert [arguments.fraction(text) for text in ("5%", "5e-2", "0")] == [0.05, 0.05, 0.0]
    for kind, texts in (
        (arguments.whole(0), ("-1", "1.5", "nan", "1e999999999", "x", "")),
        (arguments.real, ("nan", "inf", "1e999", "x")),
        (arguments.positive("newtons"), ("0", "-1", "inf", "x")),
        (arguments.fraction, ("1", "5", "-0.1", "100%", "nan")),
    ):
        for text in texts:
            with pytest.raises(arguments.argparse.ArgumentTypeError, match=f"'{text}' must be a"):
                kind(text)
    parser = arguments.Parser("", "")
    parser.add_argument("--start", type=arguments.real, nargs=2)
    assert parser.parse_args(["--start", "-1e-3", "2"]).start == [-1e-3, 2.0]
    command = load("evaluate").parse(["--controller", "lqr,smc", "--scenario", "regulation,tracking", "--runs", "1e1"])
    assert (command.controller, command.scenario, command.runs) == (["lqr", "smc"], ["regulation", "tracking"], 10)
