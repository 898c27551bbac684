"""How a command was started, and what must hold before the imports that take seconds. Nothing slow is imported here."""

import os
import signal
import sys
from pathlib import Path

INTERRUPTED = 130
"""Exit code of a command that Ctrl-C has ended."""
SCRIPT, MODULE = "smo-gym", "python -m smo_gym"
_PACKAGE = Path(__file__).resolve().parents[1]


def program() -> str | None:
    """What the user started: smo-gym, python -m smo_gym, or a file of agents/ by its name.

    Returns:
        None where another program imports this package.
    """
    typed = sys.argv[0] if sys.argv else ""
    file = Path(typed).resolve()
    if Path(typed).stem == SCRIPT:
        return SCRIPT
    looked_for = typed == "-m" and f" {MODULE.partition(' ')[2]} " in f"{' '.join(sys.orig_argv)} "
    if looked_for or file == _PACKAGE / "__main__.py":
        return MODULE
    in_agents = file.parent == _PACKAGE.parent / "agents" and (_PACKAGE / "cli" / file.name).is_file()
    return file.name if in_agents else None


def called(command: str = "") -> str:
    """A command as messages name it: evaluate.py, or smo-gym evaluate; of no command, the program."""
    name = program() or SCRIPT
    return name if name.endswith(".py") else f"{name} {command}".rstrip()


def line(command: str) -> str:
    """What runs a command, in the way that this one was: python agents/evaluate.py, or smo-gym evaluate."""
    name = program() or SCRIPT
    return f"python agents/{command}.py" if name.endswith(".py") else f"{name} {command}"


def is_command() -> bool:
    """Whether this process is a command: not another program, nor a process that a command has started."""
    return program() is not None and sys.argv[0] in sys.orig_argv


def begin() -> None:
    """Ctrl-C while importing is one line, unless the parent ignores it; no file becomes a closed console."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # 0, 1 and 2 are taken from now on
    os.close(descriptor)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: leave(called()))


def leave(name: str) -> None:
    """End the process at once, with a line."""
    try:
        os.write(2, f"{name}: interrupted\n".encode())
    finally:
        os._exit(INTERRUPTED)
