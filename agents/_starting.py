"""What must hold before a command's imports, which take seconds. Nothing slow is imported here."""

import os
import signal
import sys
from contextlib import suppress


def begin() -> None:
    """Ctrl-C while importing is one line, unless the parent ignores it; no file becomes a closed console."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # 0, 1 and 2 are taken from now on
    os.close(descriptor)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def _leave(*_: object) -> None:
    with suppress(OSError):
        os.write(2, f"{os.path.basename(sys.argv[0])}: interrupted\n".encode())
    os._exit(130)
