"""Files: settings read, results written; what cannot be is named early, and nothing is left half written."""

import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from . import yaml_text

_PART = ".smo_gym-"  # a name of what is not complete yet begins so
_COMPLETE = ".smo_gym.complete"  # a set of files that waits for its place
_ORDER = ".order"  # which files of an old set go, which come, in turn


def read_yaml(path: Path) -> Any:
    """What a YAML file holds.

    Raises:
        ValueError: it cannot be read, is not YAML or more than settings are (:mod:`~smo_gym.yaml_text`); the
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


def refuse_pickle(path: Path) -> None:
    """See that no state of an older version lies there, which only unpickling could read.

    Raises:
        ValueError: one lies there.
    """
    if path.exists():
        raise ValueError(f"{path}: is of an older version and is not opened, for that could run any code: remove it")


def shortened(text: str, most: int = 400) -> str:
    """A message as one line that can be read."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most // 2]} ... {line[5 - most // 2 :]}"


def prepare(folder: Path, option: str = "--out", names: Iterable[str] = ()) -> Path:
    """Make a folder for results and prove that it can be written to, before any work is done for it.

    Args:
        folder: for the results.
        option: what asked for it.
        names: of files that will be written there.

    Raises:
        ValueError: it cannot be made or written to, or a folder stands where a file is to be.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ValueError(f"{option} {folder}: cannot be written to ({error.strerror})") from None
    for name in names:
        if (folder / name).is_dir():
            raise ValueError(
                f"{option} {folder}: {folder / name} is a folder, where a file is to be written: remove it or choose "
                f"another {option}"
            )
    return folder


@contextmanager
def claimed(folder: Path, names: Iterable[str] = ()) -> Iterator[Path]:
    """A folder of results, prepared, and nobody else's while a block runs.

    What a command that was killed has left there is put into place where it was complete, else removed.

    Args:
        folder: given with ``--out``.
        names: of files that will be written there.

    Raises:
        ValueError: it cannot be made or written to, a folder stands where a file is to be, or another command is
            writing there.
    """
    prepare(folder, names=names)
    with _locked(folder):
        _put_into_place(folder)
        for rest in folder.glob(f"{_PART}*"):
            shutil.rmtree(rest) if rest.is_dir() else rest.unlink()
        yield folder


def write(path: Path, text: str) -> None:
    """Write a text file as a whole: whoever looks finds the old one or the new one."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file of bytes as a whole: whoever looks finds the old one or the new one.

    Raises:
        OSError: it cannot be written; the file is named.
    """
    part = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=_PART, delete=False) as file:
            part = Path(file.name)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(part, 0o644)
        os.replace(part, path)  # closed: an open file has no other name on Windows
    except BaseException as error:  # an interruption too
        if part is not None:
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def write_set(folder: Path, contents: Mapping[str, str | bytes], replaced: Iterable[str] = ()) -> None:
    """Write files that belong together in place of those of an older set: no two sets are ever mixed.

    First all bytes are brought to the disk beside. Then the old files go and the new ones come, the last file first and
    last: a set is there when that file is. A command killed in between is completed by the next (:func:`claimed`).

    Args:
        folder: where they are to be.
        contents: by name, which may be in a folder inside; the last says what run they are of.
        replaced: names of an older set's files, which go.

    Raises:
        OSError: they cannot be written; the file is named, and the old set stands.
    """
    part = Path(tempfile.mkdtemp(dir=folder, prefix=_PART))
    try:
        for name, data in contents.items():
            (part / name).parent.mkdir(exist_ok=True)
            if isinstance(data, str):
                write(part / name, data)
            else:
                write_bytes(part / name, data)
        write(part / _ORDER, json.dumps({"old": [*replaced, *contents], "new": list(contents)}))
        os.replace(part, folder / _COMPLETE)
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        if isinstance(error, OSError) and error.filename:
            name = os.path.relpath(error.filename, part)
            raise OSError(error.errno, error.strerror, str(folder / name)) from None
        raise
    try:
        _put_into_place(folder)
    except KeyboardInterrupt:
        _put_into_place(folder)
        raise


def _put_into_place(folder: Path) -> None:
    """Replace an old set of files by a new one that waits complete; where this was cut short, go on."""
    complete = folder / _COMPLETE
    if not complete.is_dir():
        return
    order = json.loads((complete / _ORDER).read_text()) if (complete / _ORDER).exists() else {"old": [], "new": []}
    old, new = ([name for name in order[key] if _is_inside(folder, name)] for key in ("old", "new"))
    waiting = [name for name in new if (complete / name).exists()]
    if waiting == new:  # none has come yet, so what is there is old
        for name in reversed(old):
            (folder / name).unlink(missing_ok=True)
    for name in waiting:
        (folder / name).parent.mkdir(exist_ok=True)
        os.replace(complete / name, folder / name)
    shutil.rmtree(complete)


def _is_inside(folder: Path, name: str) -> bool:
    return (folder / name).parent.resolve().is_relative_to(folder.resolve())


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a folder; the system lets go of it when the process ends, however it ends."""
    try:
        held = _lock(folder)
    except (BlockingIOError, FileExistsError):
        raise ValueError(
            f"--out {folder}: another command is writing there: wait for its end or choose another --out"
        ) from None
    except OSError:  # a file system without locks
        held = None
    try:
        yield
    finally:
        if held is not None:
            os.close(held)


def _lock(folder: Path) -> int:
    if sys.platform == "win32":  # no folder can be opened there, but a file can vanish with its process
        return os.open(folder / ".lock", os.O_CREAT | os.O_EXCL | os.O_TEMPORARY)
    import fcntl

    held = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(held)
        raise
    return held
