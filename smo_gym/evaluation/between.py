"""What stands between the plants and the computer, in words: it goes before all numbers."""

from __future__ import annotations

from collections.abc import Iterable

from ..presets import said
from .scenario import Scenario

UNPUBLISHED = (
    "The published numbers are of exact sensors, ideal actuators, no friction and no disturbance: they are left out."
)


def lines(scenarios: Iterable[Scenario]) -> list[str]:
    """A line for each sensor, actuator, friction and disturbance that is not the article's; none where all are."""
    tables: dict[str, list[str]] = {}
    places = {id(place): place for place in scenarios}.values()
    for place in places:
        for text in _of(place):
            tables.setdefault(text, []).append(place.table)
    told = [text if len(of) == len(places) else f"Table {', '.join(of)}: {text}" for text, of in tables.items()]
    return [*told, UNPUBLISHED] if told else []


def _of(place: Scenario) -> list[str]:
    task = place.task
    rubs = task.rubs
    found = {
        "sensor": None if task.sensor.exact else task.sensor,
        "actuator": None if task.actuator.ideal else task.actuator,
        "friction": rubs or None,
        "disturbance": task.disturbance or None,
    }
    told = []
    for kind, settings in found.items():
        if settings is not None:
            given = place.options[kind].value if kind in place.options else None
            named = f"{given}, " if isinstance(given, str) else ""
            told.append(f"{kind}: {named}{said(settings)}")
    if rubs and task.friction_uncertainty > 0.0:
        told.append(f"friction uncertainty: {100.0 * task.friction_uncertainty:g} %")
    return told
