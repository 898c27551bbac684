"""Files: settings read, results written; what cannot be is named early, and nothing is left half written."""

import os
import tempfile
from pathlib import Path
from typing import Any

import yaml

from . import yaml_text


def read_yaml(path: Path) -> Any:
    """What a YAML file holds.

    Raises:
        ValueError: it cannot be read, is not YAML or more than settings are (:mod:`~smo_gym.evaluation.yaml_text`); the
            file is named.
    """
    most = yaml_text.MOST_CHARACTERS
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(most + 1)
        if len(text) > most:
            raise ValueError(f"{path}: has more than {most:,} characters, which no settings need")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is not YAML ({error})") from None
    try:
        return yaml_text.load(text)
    except yaml_text.Unsuitable as error:
        raise ValueError(f"{path}: {error}") from None
    except (yaml.YAMLError, ValueError, LookupError, AttributeError) as error:  # !!bool maybe is a KeyError
        raise ValueError(f"{path}: is not YAML ({shortened(str(error))})") from None


def shortened(text: str, most: int = 400) -> str:
    """A message as one line that can be read."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most // 2]} ... {line[5 - most // 2 :]}"


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
