"""``smo-gym COMMAND``: each command is the module of its name, which is imported when it is wanted."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from .arguments import Parser, one_of
from .entry import command

COMMANDS = {
    "evaluate": "measure controllers on the article's scenarios, beside the published numbers",
    "compare": "the RL table: learned policies, LQR and SMC on the same plants",
    "train": "train a policy with PPO on what an agent can know",
    "theorem": "the theorem's conditions, designed gains and promised times",
    "upright": "how often the upright plant falls",
    "robustness": "real encoders, and the largest push that the upright plant stands",
    "observers": "a dozen observers and more, on simulated encoders and on recordings of real ones",
    "observe": "estimate velocities of a plant of your own from a CSV file",
    "laws": "laws without chatter and their rivals, tuned alike, on estimates",
    "settle": "what the compensation does, and each of the article's claims with a number and a verdict",
    "tune": "tune observers or laws, all with the same budget",
    "fit": "fit a rig's model and noise to its recordings, with standard errors",
    "consistency": "the article's averages and reductions against its own cells",
    "identify": "recover what the article does not print",
    "reference": "the minimum-energy reference of the tracking scenario",
    "presets": "sensors, actuators, friction and disturbances by name, with sources",
    "watch": "a run of any controller, in a window or as a GIF, WebP or MP4",
    "animate": "a run of LQR or SMC as a GIF or WebP",
}
"""What each command does, in a line, by its name."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that comes first; its exit code, 2 where there is no such command."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given and given[0] in COMMANDS:
        run = import_module(f"{__package__}.{given[0]}").main
        return int(run(given[1:]))
    return without_command(given[:1])


@command("")
def without_command(arguments: Sequence[str] | None = None) -> int:
    """Say what there is, or that there is no such command."""
    width = max(map(len, COMMANDS))
    listed = "\n".join(f"  {name:{width}}  {what}" for name, what in COMMANDS.items())
    parser = Parser("", f"Sliding mode estimation and control of an uncertain cart pendulum.\n\ncommands:\n{listed}")
    parser.usage = "%(prog)s COMMAND ..."
    parser.epilog = "%(prog)s COMMAND --help tells a command's arguments."
    known = one_of("command", [*COMMANDS])
    parser.add_argument("command", metavar="COMMAND", type=known, help=argparse.SUPPRESS)
    parser.parse_args(arguments)
    return 0
