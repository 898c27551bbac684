"""Settings read from YAML files that may extend others, and what is wrong with them in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from reprlib import repr as short
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from .. import files
from ..validation import unknown
from . import configs

T = TypeVar("T", bound=BaseModel)
MOST_FILES = 16
"""Most files that extend each other."""
MOST_FAULTS = 5
"""Most faults that a message names."""


def read(path: Path, kind: type[T]) -> T:
    """Settings from a file; ``extends: FILE`` starts from another file beside it, or by its name from one of ours.

    Raises:
        ValueError: the file cannot be read, is no YAML, or has an unknown, missing or bad value, named with its place.
    """
    data = _read(path, ())
    try:
        return validated(data, kind)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def validated(data: Mapping[str, Any], kind: type[T]) -> T:
    """Settings from a mapping.

    Raises:
        ValueError: an unknown, missing or bad value, named with its place.
    """
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        faults = error.errors()
        words = [files.shortened(_explain(fault, kind)) for fault in faults[:MOST_FAULTS]]
        more = [f"and {len(faults) - MOST_FAULTS:,} more"] * (len(faults) > MOST_FAULTS)
        raise ValueError("; ".join([*words, *more])) from None


def _read(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    data = files.read_yaml(path)
    if not isinstance(data, dict):
        raise ValueError(f"{path}: must be a mapping of settings")
    base = data.pop("extends", None)
    if base is None:
        return data
    if not isinstance(base, str):
        raise ValueError(f"{path}: extends={short(base)} must be the name of a file")
    above = (*above, path.resolve())
    found = path.parent / base
    if not found.is_file() and base in configs.names():
        found = configs.path(base)
    if not found.is_file():
        raise ValueError(
            f"{path}: extends={short(base)} is no file: it must be named as it is found from {path.parent}/, or be one "
            f"of {', '.join(configs.names())}"
        )
    if found.resolve() in above:
        raise ValueError(f"{path}: extends itself")
    if len(above) > MOST_FILES:
        raise ValueError(f"{path}: is the {len(above)}th file of a chain of extends, of {MOST_FILES} at most")
    return _merged(_read(found, above), data)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """``over`` on top of ``base``; a setting, which has a value, is replaced as a whole."""
    both = {
        key: _merged(base[key], value)
        for key, value in over.items()
        if isinstance(value, dict) and isinstance(base.get(key), dict) and "value" not in value
    }
    return {**base, **over, **both}


def _explain(error: Any, kind: type[BaseModel]) -> str:
    place = [files.shortened(str(part), 60) for part in error["loc"]]
    start = f"{'.'.join(place)}: " if place else ""
    if error["type"] == "extra_forbidden":
        return start + unknown("setting", place[-1], _fields(place[:-1], kind))
    message = error["msg"].removeprefix("Value error, ")
    for value in filter(lambda value: isinstance(value, str), error.get("ctx", {}).values()):
        message = message.replace(value, files.shortened(value, 60))
    given = f" (given {short(error['input'])})" if place and error["type"] != "missing" else ""
    return f"{start}{message}{given}"


def _fields(place: list[str], kind: type[BaseModel]) -> list[str]:
    """The settings that exist at a place of the configuration."""
    kinds: list[Any] = [kind]
    for part in place:
        found: list[Any] = []
        for kind in kinds:
            field = getattr(kind, "model_fields", {}).get(part)
            found += models(field.annotation) if field is not None else [kind]  # a name or a tag: stay
        kinds = found
    return sorted({name for kind in kinds for name in getattr(kind, "model_fields", {})})


def models(annotation: Any) -> list[type[BaseModel]]:
    """All models inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models(inner)]
