"""The sensors, actuators, friction and disturbances that have a name, with the source of their numbers.

smo-gym presets                    # all
smo-gym presets sensor cart-pole   # one, every field of it
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..presets import KINDS, Preset, said
from ..validation import choice
from .arguments import Parser, one_of
from .console import screen
from .entry import command


@command("presets")
def main(arguments: Sequence[str] | None = None) -> int:
    """List; 0, or 2 where there is nothing of a name."""
    parser = Parser("presets", __doc__)
    parser.add_argument(
        "kind", nargs="?", type=one_of("kind", [*KINDS]), metavar="KIND", help=f"{', '.join(KINDS)}; all by default"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="of a preset; all by default")
    args = parser.parse_args(arguments)
    if args.name is not None:
        choice(args.kind, args.name, KINDS[args.kind])
    _show({kind: known for kind, known in KINDS.items() if args.kind in (None, kind)}, args.name)
    return 0


def _show(kinds: Mapping[str, Mapping[str, Preset[Any]]], name: str | None) -> None:
    from rich.padding import Padding

    console = screen()
    for kind, known in kinds.items():
        for preset_name, preset in known.items():
            if name not in (None, preset_name):
                continue
            console.print(f"{kind}={preset_name!r}", style="bold")
            told = said(preset.settings, whole=name is not None) or "as the default"
            console.print(Padding(told, (0, 0, 0, 4)))
            if preset.dt is not None:
                console.print(Padding(f"at dt={preset.dt:g} s alone, which its samples are counted of", (0, 0, 0, 4)))
            console.print(Padding(preset.source, (0, 0, 0, 4)), style="dim")
    console.file.flush()
