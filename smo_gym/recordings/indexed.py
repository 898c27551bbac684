"""Files that are what an index says they are: checked where they lie, or downloaded."""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from .rig import Rig

INDEX = "index.csv"
"""In the folder of all recordings: files, hashes and where they come from."""
FROM = "https://raw.githubusercontent.com"
_NAMED, _PUBLISHED = ("file", "sha256"), ("repository", "commit", "path")


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the index."""

    file: str
    """Below the folder of the index."""
    sha256: str
    repository: str
    commit: str
    path: str

    @property
    def url(self) -> str:
        """Where the file was published."""
        return f"{FROM}/{self.repository}/{self.commit}/{quote(self.path)}"


def entries(folder: Path, below: str) -> list[Entry]:
    """What the index of a folder says of the files below one of its own folders; nothing where there is no index.

    Names and hashes must be there; where files come from only matters to :func:`fetch`.

    Raises:
        ValueError: the index cannot be read, or lacks a column.
    """
    path = folder / INDEX
    if not path.exists():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file)
            header = rows.fieldnames or ()
            found = [Entry(*(row.get(name) or "" for name in (*_NAMED, *_PUBLISHED))) for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: cannot be read ({error})") from None
    for name in _NAMED:
        if name not in header:
            raise ValueError(f"{path}: lacks the column {name!r}")
    return [entry for entry in found if entry.file.startswith(f"{below}/")]


def check(folder: Path, entry: Entry) -> None:
    """See that a file is the one that its index names.

    Raises:
        ValueError: it is missing or another.
    """
    path = folder / entry.file
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ValueError(
            f"{path}: {INDEX} names it and it cannot be read ({error.strerror}): fetch it, or remove its line"
        ) from None
    if found != entry.sha256:
        raise ValueError(
            f"{path}: is not the file that {INDEX} names (its SHA-256 is {found}, not {entry.sha256}): nothing is "
            "used; remove the file and fetch it again, or its line in the index"
        )


def fetch(rig: Rig, folder: Path) -> None:
    """Download what the index of a folder names of a rig and is not there yet.

    A file whose hash is not the index's is not kept.

    Raises:
        ValueError: there is no index, a file that is there already is another, or one cannot be downloaded as it was.
        ImportError: the package pooch is missing.
    """
    try:
        import pooch  # type: ignore[import-untyped]
    except ImportError:
        raise ImportError('downloading recordings needs pooch: pip install "smo_gym[recordings]"') from None
    wanted = entries(folder, rig.name)
    if not wanted or not all(entry.repository and entry.commit and entry.path for entry in wanted):
        raise ValueError(
            f"{folder / INDEX}: must say of the files in {rig.name}/ their {', '.join((*_NAMED, *_PUBLISHED))}"
        )
    for entry in wanted:
        path = folder / entry.file
        if path.exists():
            check(folder, entry)
            continue
        try:
            pooch.retrieve(entry.url, f"sha256:{entry.sha256}", fname=path.name, path=path.parent)
        except (OSError, ValueError) as error:  # of the network; of the hash
            raise ValueError(f"{entry.file}: cannot be had as it was from {entry.url} ({error})") from None
