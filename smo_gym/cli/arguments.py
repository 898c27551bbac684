"""Command lines: one parser, and one way to read numbers, for all commands."""

from __future__ import annotations

import argparse
import math
import platform
import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal, InvalidOperation
from importlib import metadata
from pathlib import Path
from typing import Any, NoReturn

from .. import __version__
from ..validation import unknown
from . import starting

PACKAGES = ("smo_gym", "gymnasium", "numba", "numpy", "scipy")
DIGITS = 30
"""Most digits of a whole number: more are no seed and no count, and 1e999999999 would fill the memory."""


class Parser(argparse.ArgumentParser):
    """A parser that raises ValueError, knows ``--version``, and has what several commands have in common.

    Args:
        command: its name.
        description: its docstring, where ``smo-gym NAME`` stands for what the user typed.
    """

    def __init__(self, command: str, description: str | None) -> None:
        super().__init__(
            prog=starting.called(command),
            description=re.sub(rf"{starting.SCRIPT} (\w+)", lambda found: starting.line(found[1]), description or ""),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?%?$", re.IGNORECASE)
        self.add_argument("--version", action=_Version, nargs=0, help="say the versions of all that takes part")

    def runs(self, default: int, what: str, note: str = "") -> None:
        """``--runs``, so many of something random."""
        told = f"{what} (default {default}{note})"
        self.add_argument("--runs", type=whole(1), default=default, metavar="N", help=told)

    def seed(self, of: str) -> None:
        """``--seed``, of something random."""
        self.add_argument("--seed", type=whole(0), default=0, help=f"of {of} (default 0)")

    def out(self, default: str | None, what: str = "folder") -> None:
        """``--out``, a folder; None is none."""
        path, told = Path(default) if default else None, f"{what} (default: {default or 'none'})"
        self.add_argument("--out", type=Path, default=path, metavar="DIR", help=told)

    def error(self, message: str) -> NoReturn:
        """Raise instead of exit: :func:`smo_gym.cli.entry.command` says it."""
        raise ValueError(message)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print("\n".join(f"{name} {version}" for name, version in versions().items()))
        parser.exit()


def versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Versions of Python and packages: of this one that of the code that runs, of another "unknown" if not installed.

    Metadata of this package would be wrong of a checkout that has changed since it was installed.
    """
    found = {"python": platform.python_version()}
    for name in packages:
        if name == "smo_gym":
            found[name] = __version__
            continue
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "unknown"
    return found


def one_of(what: str, known: Sequence[str]) -> Callable[[str], str]:
    """An argument type: one of some names, with a suggestion for any other."""

    def parse_name(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(unknown(what, text, known))
        return text

    return parse_name


class _Flat(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, *_: Any) -> None:
        setattr(namespace, self.dest, [value for part in values for value in part])


def several(kind: Callable[[str], Any]) -> dict[str, Any]:
    """What makes an argument a list, separated by spaces or by commas (a file's name may hold one)."""

    def parse_part(text: str) -> list[Any]:
        return [kind(part) for part in ([text] if Path(text).exists() else text.split(","))]

    return {"type": parse_part, "nargs": "+", "action": _Flat}


def whole(least: int) -> Callable[[str], int]:
    """An argument type: a whole number of at least ``least``, also as 1e6."""

    def parse_whole(text: str) -> int:
        value = _decimal(text)
        if value is None or value.adjusted() > DIGITS or value != value.to_integral_value() or value < least:
            raise argparse.ArgumentTypeError(f"{text!r} must be a whole number of at least {least}")
        return int(value)

    return parse_whole


def real(text: str) -> float:
    """An argument type: a finite number, also as 3e-4."""
    value = _decimal(text)
    if value is None or not math.isfinite(float(value)):
        raise argparse.ArgumentTypeError(f"{text!r} must be a finite number")
    return float(value)


def positive(unit: str) -> Callable[[str], float]:
    """An argument type: a finite number of some unit above 0."""

    def parse_positive(text: str) -> float:
        value = _decimal(text)
        if value is None or not 0.0 < float(value) < math.inf:
            raise argparse.ArgumentTypeError(f"{text!r} must be a positive number of {unit}")
        return float(value)

    return parse_positive


def fraction(text: str) -> float:
    """An argument type: a fraction in [0, 1), also as a percentage."""
    value = _decimal(text.removesuffix("%"))
    result = -1.0 if value is None else float(value) / (100.0 if text.endswith("%") else 1.0)
    if not 0.0 <= result < 1.0:
        raise argparse.ArgumentTypeError(
            f"{text!r} must be a fraction in [0, 1) such as 0.05, or a percentage such as 5%"
        )
    return result


def _decimal(text: str) -> Decimal | None:
    """A number as it is written, or None; infinity and NaN are none."""
    try:
        value = Decimal(text.strip())
    except InvalidOperation:
        return None
    return value if value.is_finite() else None
