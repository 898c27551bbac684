"""Checks of settings that each position has its own of."""

from __future__ import annotations

from typing import Any

from ..validation import array


def positive(name: str, value: Any) -> tuple[float, float]:
    """Two positive numbers, one a position.

    Raises:
        ValueError: they are not.
    """
    found = array(name, value, (2,))
    if (found <= 0.0).any():
        raise ValueError(f"{name}={found.tolist()} must be positive, one number for each position")
    first, second = found.tolist()
    return first, second
