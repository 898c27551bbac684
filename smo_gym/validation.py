"""Checks of arguments whose messages name the argument, the value and what is allowed."""

import difflib
import math
import numbers
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .typing import Array

T = TypeVar("T")

MOST = 1e8
"""Most integration steps in a control period, or control periods in an episode: more is a slip, not a simulation."""
_LONGEST = 200  # characters of a value in a message
_REPR = reprlib.Repr()
_REPR.maxlist = _REPR.maxtuple = _REPR.maxdict = 12
_REPR.maxstring = _REPR.maxother = _LONGEST


def number(name: str, value: Any, *, above: float = -math.inf, below: float = math.inf) -> float:
    """A finite number strictly between two bounds, as a float.

    Raises:
        ValueError: it is not.
    """
    try:
        result = (
            float(value) if isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_) else math.nan
        )
    except OverflowError:
        result = math.inf
    if not (math.isfinite(result) and above < result < below):
        bounds = [f"greater than {above:g}"] * math.isfinite(above) + [f"less than {below:g}"] * math.isfinite(below)
        raise ValueError(f"{name}={short(value)} must be a finite number{' ' if bounds else ''}{' and '.join(bounds)}")
    return result


def whole(name: str, value: Any, least: int) -> int:
    """A whole number, Python's or NumPy's, of at least ``least``, as an int.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, numbers.Integral) or isinstance(value, bool) or value < least:
        kind = "positive integer" if least == 1 else f"whole number of at least {least}"
        raise ValueError(f"{name}={short(value)} must be a {kind}")
    return int(value)


def limit(name: str, value: Any) -> float:
    """A positive bound, where None stands for no bound (infinity).

    Raises:
        ValueError: it is neither None nor a positive number.
    """
    if value is None or (isinstance(value, numbers.Real) and value == math.inf):
        return math.inf
    return number(name, value, above=0.0)


def mapping(what: str, value: Any, known: Iterable[str]) -> dict[str, Any]:
    """A mapping whose keys are all known ones.

    Raises:
        ValueError: it is not a mapping, or a key is unknown, with a suggestion.
    """
    if not isinstance(value, Mapping):
        raise ValueError(
            f"{what}: {short(value)} must be a mapping with the keys {', '.join(map(repr, sorted(map(str, known))))}"
        )
    for name in value:
        choice(what, name, known)
    return dict(value)


def instance(cls: type[T], what: str, value: Any) -> T:
    """A dataclass's instance from itself, a mapping of its fields or None for its defaults.

    Raises:
        ValueError: an unknown field, or a value that is not allowed.
    """
    if isinstance(value, cls):
        return value
    return cls(**mapping(what, {} if value is None else value, [f.name for f in fields(cls)]))  # type: ignore[arg-type]


def array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """A finite float64 array of the given shape (a copy).

    Raises:
        ValueError: the shape differs, or an entry is not a finite number.
    """
    try:
        result = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}={short(value)} must be an array of numbers of shape {shape}") from None
    if result.shape != shape:
        raise ValueError(f"{name} has shape {result.shape}, it must have shape {shape}")
    if not np.isfinite(result).all():
        raise ValueError(f"{name}={short(result.tolist())} must be finite")
    return result


def positive_pair(name: str, value: ArrayLike) -> tuple[float, float]:
    """Two finite numbers above 0, one for each position.

    Raises:
        ValueError: they are not.
    """
    first, second = array(name, value, (2,)).tolist()
    if first <= 0.0 or second <= 0.0:
        raise ValueError(f"{name}={short(value)} must be two numbers greater than 0, one for each position")
    return first, second


def switch(name: str, value: Any) -> bool:
    """True or False, Python's or NumPy's.

    Raises:
        ValueError: it is neither.
    """
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name}={short(value)} must be True or False")
    return bool(value)


def shape_of(value: Any) -> tuple[int, ...] | None:
    """The shape of what may be an array; None for rows of different lengths."""
    try:
        return tuple(np.shape(value))
    except ValueError:
        return None


def observed(observation: Any) -> Array:
    """An observation, or several as rows, as an array of floats.

    Raises:
        ValueError: it is neither.
    """
    shape = shape_of(observation)
    found = np.asarray(observation if shape is not None else "")
    if found.dtype.kind not in "fiu" or found.ndim not in (1, 2):
        raise ValueError(
            f"observation={short(observation)} must be an array of numbers: one observation, or some as rows"
        )
    return found.astype(np.float64, copy=False)


def multiple(name: str, value: Any, of_name: str, of: float) -> int:
    """How many times ``of`` goes into ``value``: a whole number from 1 to :data:`MOST`.

    Raises:
        ValueError: it is no such number.
    """
    ratio = number(name, value, above=0.0) / number(of_name, of, above=0.0)
    if ratio > MOST:
        raise ValueError(f"{name}={value!r} must be at most {MOST:g} times {of_name}={of!r}")
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        raise ValueError(f"{name}={value!r} must be a whole multiple of {of_name}={of!r}")
    return round(ratio)


def short(value: Any) -> str:
    """A value in a message: its repr, cut where it is long."""
    try:
        text = _REPR.repr(value)
    except Exception:  # whatever a user's repr may raise, or an integer of too many digits
        return f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """The message for a name that nothing answers to, with the nearest name that exists."""
    known = sorted(map(str, known))  # a file's keys may be numbers
    lower = {word.lower(): word for word in known}
    near = difflib.get_close_matches(str(name).lower(), lower, n=1, cutoff=0.5)
    hint = f"did you mean {lower[near[0]]!r}? " if near else ""
    return f"unknown {what} {short(name)}: {hint}known are {', '.join(map(repr, known))}"


def choice(what: str, name: Any, known: Iterable[str]) -> str:
    """The name itself when it is one of the known ones.

    Raises:
        ValueError: it is not, with a suggestion.
    """
    known = list(known)
    if not isinstance(name, str) or name not in known:
        raise ValueError(unknown(what, name, known))
    return str(name)
