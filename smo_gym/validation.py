"""Checks of arguments whose messages name the argument, the value and what is allowed."""

import difflib
import math
import numbers
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def number(name: str, value: Any, *, above: float = -math.inf, below: float = math.inf) -> float:
    """A finite number strictly between two bounds, as a float.

    Raises:
        ValueError: it is not.
    """
    plain = isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)
    result = float(value) if plain else math.nan
    if not (math.isfinite(result) and above < result < below):
        bounds = [f"greater than {above:g}"] * math.isfinite(above) + [f"less than {below:g}"] * math.isfinite(below)
        raise ValueError(f"{name}={value!r} must be a finite number{' ' if bounds else ''}{' and '.join(bounds)}")
    return result


def limit(name: str, value: Any) -> float:
    """A positive bound, where None stands for no bound (infinity).

    Raises:
        ValueError: it is neither None nor a positive number.
    """
    if value is None or value == math.inf:
        return math.inf
    return number(name, value, above=0.0)


def mapping(what: str, value: Any, known: Iterable[str]) -> dict[str, Any]:
    """A mapping whose keys are all known ones.

    Raises:
        ValueError: it is not a mapping, or a key is unknown, with a suggestion.
    """
    if not isinstance(value, Mapping):
        raise ValueError(
            f"{what}: {value!r} must be a mapping with the keys {', '.join(map(repr, sorted(map(str, known))))}"
        )
    for name in value:
        choice(what, name, known)
    return dict(value)


def array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """A finite float64 array of the given shape (a copy).

    Raises:
        ValueError: the shape differs, or an entry is not a finite number.
    """
    try:
        result = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}={value!r} must be an array of numbers of shape {shape}") from None
    if result.shape != shape:
        raise ValueError(f"{name} has shape {result.shape}, it must have shape {shape}")
    if not np.isfinite(result).all():
        raise ValueError(f"{name}={result.tolist()!r} must be finite")
    return result


def multiple(name: str, value: Any, of_name: str, of: float) -> int:
    """How many times ``of`` goes into ``value``: a whole number, at least 1.

    Raises:
        ValueError: it is no whole number.
    """
    ratio = number(name, value, above=0.0) / of
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
        raise ValueError(f"{name}={value!r} must be a whole multiple of {of_name}={of!r}")
    return round(ratio)


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """The message for a name that nothing answers to, with the nearest name that exists."""
    known = sorted(map(str, known))  # a file's keys may be numbers
    lower = {word.lower(): word for word in known}
    near = difflib.get_close_matches(str(name).lower(), lower, n=1, cutoff=0.5)
    hint = f"did you mean {lower[near[0]]!r}? " if near else ""
    return f"unknown {what} {name!r}: {hint}known are {', '.join(map(repr, known))}"


def choice(what: str, name: Any, known: Iterable[str]) -> str:
    """The name itself when it is one of the known ones.

    Raises:
        ValueError: it is not, with a suggestion.
    """
    known = list(known)
    if name not in known:
        raise ValueError(unknown(what, name, known))
    return str(name)
