"""Files: settings read, results written; what cannot be is named early, and nothing is left half written."""

import os
import tempfile
from pathlib import Path
from typing import Any

import yaml


def read_yaml(path: Path) -> Any:
    """What a YAML file holds.

    Raises:
        ValueError: it cannot be read or is not YAML; the file is named.
    """
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except (yaml.YAMLError, ValueError) as error:  # a ValueError is of bytes that are no text, or of no date
        raise ValueError(f"{path}: is not YAML ({' '.join(str(error).split())})") from None


def prepare(folder: Path, option: str = "--out") -> Path:
    """Make a folder for results and prove that it can be written to, before any work is done for it.

    Raises:
        ValueError: it cannot be made or written to; ``option`` asked for it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(f"{option} {folder}: cannot be written to ({error.strerror})") from None
    return folder


def write(path: Path, text: str) -> None:
    """Write a text file as a whole: whoever looks finds the old one or the new one."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """The same of any file."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        try:
            file.write(data)
            file.flush()
            os.chmod(file.name, 0o644)
            os.replace(file.name, path)
        except BaseException:  # an interruption too
            Path(file.name).unlink(missing_ok=True)
            raise
