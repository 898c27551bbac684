"""The settings of some runs as rows to read: value, source and note."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from ...article import OBSERVER_GAINS
from ...plant import CartPendulum
from ..scenario import Scenario
from ..study import Outcome

_PLANT = {"cart_mass": "kg; M_c", "bob_mass": "kg; m", "rod_length": "m; l", "gravity": "m/s²; g"}


class _Row(NamedTuple):
    name: str
    value: str
    source: str
    note: str


def sources(outcomes: Sequence[Outcome]) -> list[dict[str, str]]:
    """Every setting with its source; those that scenarios share once, with the tables that they belong to."""
    scenarios = {id(o.group.scenario): o.group.scenario for o in outcomes}
    found: dict[_Row, list[str]] = {}
    for scenario in scenarios.values():
        for row in (*_plant(scenario, outcomes), *_walk(scenario.model_dump(mode="json"), ())):
            found.setdefault(row, []).append(scenario.table)
    order = list(dict.fromkeys(row.name for row in found))
    rows = sorted(found, key=lambda row: order.index(row.name))
    return [{**row._asdict(), "tables": ", ".join(dict.fromkeys(found[row]))} for row in rows]


def settings(tree: Any) -> list[dict[str, str]]:
    """The settings in a tree, each a row."""
    return [row._asdict() for row in _walk(tree, ())]


def _plant(scenario: Scenario, outcomes: Sequence[Outcome]) -> Iterable[_Row]:
    """The nominal plant, which the runs at 0 % have."""
    plant = CartPendulum.of(
        next(
            o.plants[0]
            for o in outcomes
            if o.group.scenario is scenario and o.group.uncertainty == 0.0 and o.plants is not None
        )
    )
    printed = CartPendulum().as_dict()
    params = scenario.options["params"].value if "params" in scenario.options else {}
    given = params if isinstance(params, dict) else printed  # or all, as [M_c, m, l, g]
    for name, value in plant.as_dict().items():
        same = value == printed[name]
        where = "Table 2" if same else "options.params" if name in given else scenario.environment
        yield _Row(f"plant.{name}", f"{value:g}", "printed" if same else "chosen", f"{_PLANT[name]}; {where}")


def _walk(data: Any, path: tuple[str, ...]) -> Iterable[_Row]:
    if isinstance(data, dict) and {"value", "source"} <= data.keys():
        value = data["value"]
        named = path[-1] == "gains" and isinstance(value, str)  # a column of Table 3
        yield _Row(".".join(path), _text(OBSERVER_GAINS[value] if named else value), data["source"], data["note"])
    elif isinstance(data, dict):
        for name, inner in data.items():
            if path or name not in ("table", "title", "suffix"):  # these are headings
                yield from _walk(inner, (*path, name))
    elif data is not None:
        yield _Row(".".join(path), _text(data), "", "")


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_text(inner)}" if name else _text(inner) for name, inner in value.items())
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_text, value))}]"
    if value is None:
        return "none"
    return f"{value + 0.0:.10g}" if isinstance(value, float) else str(value)
