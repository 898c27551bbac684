"""What stands between the plants and the computer, on a command line."""

from __future__ import annotations

import argparse
from typing import Any

import yaml

from .. import presets
from ..policies import named


def add(parser: argparse.ArgumentParser, own: bool = False) -> None:
    """The options; ``own`` says whether a disturbance may be a function of the user's own."""
    for name, known in presets.KINDS.items():
        more = ", or module:function of your own" if own and name == "disturbance" else ""
        parser.add_argument(
            f"--{name}",
            type=_setting,
            metavar="NAME",
            help=f"of the plants: {', '.join(known)}, or fields as YAML{more}",
        )


def data(arguments: argparse.Namespace) -> dict[str, Any]:
    """Options of the environment by name, those that are given, as data."""
    return {name: value for name in presets.KINDS if (value := getattr(arguments, name)) is not None}


def given(arguments: argparse.Namespace) -> dict[str, Any]:
    """The same with a function imported.

    Raises:
        ValueError: there is no such function.
    """
    found = data(arguments)
    if isinstance(own := found.get("disturbance"), str) and ":" in own:
        found["disturbance"] = named.own(own)
    return found


def _setting(text: str) -> Any:
    """A name, or YAML.

    Raises:
        argparse.ArgumentTypeError: it is no YAML.
    """
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        why = getattr(error, "problem", error)
        raise argparse.ArgumentTypeError(f"{text!r} is neither a name nor YAML: {why}") from None
