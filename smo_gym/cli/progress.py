"""What long work shows of itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tqdm import tqdm

from ..evaluation import study


def simulated(groups: Iterable[study.Group]) -> tqdm[Any]:
    """A bar of the simulated seconds of some groups, over all slots; it goes when all is done."""
    total = study.simulated_seconds(groups)
    return tqdm(total=total, unit="s", unit_scale=True, desc="simulated", leave=False, disable=None)
