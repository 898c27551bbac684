"""The search of ``smo-gym settle --search``: gains on training plants, that no table has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..article import WITH, WITHOUT
from ..typing import Array
from . import study
from .settling import BETA_1, BETA_2, COLUMNS, MEAN_FORCE, STATES, Column
from .store import Store, digest
from .study import Group
from .tuning import Tuned, tune

SEED, PLANTS, BUDGET, LEVEL = 10_000, 24, 80, 0.2
"""Of the training plants, which are not those of any table, and how many evaluations each search has."""
CONSTANTS = np.geomspace(0.1, 100.0, 13)
"""c in N, between which that of equal effort is interpolated."""
TRAINED = tuple(column for column in COLUMNS if column.scenario != "initial-conditions")
EVALUATIONS = len(TRAINED) * 2 * BUDGET + len(COLUMNS) * (2 + len(CONSTANTS))
Told = Callable[[int], object]


def trained(column: Column, gains: Mapping[str, Any] | None = None, arm: str = WITH) -> dict[str, float]:
    """Means of the metrics over training plants; infinite where one failed."""
    place = column.place(gains).changed(uncertainty=(LEVEL,))
    groups: list[Group] = [
        group for group in study.groups([place], [column.controller], [arm], PLANTS) if group.uncertainty > 0.0
    ]
    outcomes = study.measure(groups, SEED)
    failed = any(each.failed.any() for each in outcomes)
    names = ("mse_h", "mse_theta", "effort", MEAN_FORCE)
    return {
        name: float("inf") if failed else float(np.mean([each.metrics[name] for each in outcomes])) for name in names
    }


def matched(column: Column, told: Told) -> tuple[float, float, float]:
    """C of equal time mean and of equal effort in N, and the effort of the latter over that under compensation."""
    compensated = trained(column)
    efforts = [trained(column, arm=WITHOUT)["effort"]]
    told(2)
    for c in CONSTANTS:
        efforts.append(trained(column, column.constant(float(c)))["effort"])
        told(1)
    mean = compensated[MEAN_FORCE]
    return mean, *equal(np.array([0.0, *CONSTANTS]), np.array(efforts) / compensated["effort"], mean)


def equal(constants: Array, efforts: Array, mean: float) -> tuple[float, float]:
    """The c at which the effort is 1, interpolated, or where it comes nearest; and the effort there.

    Effort may fall and rise again with c: of several such c the one nearest to ``mean`` is taken, in ratio.
    """
    above = np.log(efforts)
    i = np.flatnonzero(above[:-1] * above[1:] < 0.0)
    if not len(i):
        nearest = int(np.argmin(np.abs(above)))
        return float(constants[nearest]), float(efforts[nearest])
    crossings = constants[i] + above[i] / (above[i] - above[i + 1]) * (constants[i + 1] - constants[i])
    return float(crossings[np.argmin(np.abs(np.log(crossings / mean)))]), 1.0


def search(column: Column, name: str, mean: float, told: Told) -> Tuned:
    """The best beta_1 without any |u|, or beta_2 beside the printed beta_1; both searches begin at equal time means.

    The cost is the mean of MSE h and MSE theta, each over that of the printed gains.

    Args:
        column: where.
        name: of the arm.
        mean: c of equal time mean.
        told: called with the number of evaluations done since the last call.
    """
    printed = trained(column)
    begin = list(column.constant(mean)["beta_1"] if name == BETA_1 else column.printed.beta_2)

    def cost(values: list[float]) -> float:
        found = trained(column, column.tuned(name, values))
        return float(np.mean([found[f"mse_{state}"] / printed[f"mse_{state}"] for state in STATES]))

    return tune(cost, begin, BUDGET, SEED, told)


def searched(store: Store, told: Told) -> dict[str, Any]:
    """All of it, as the settings file has it.

    Args:
        store: keeps what is found, and gives what was found before.
        told: called with the number of evaluations done since the last call, of :data:`EVALUATIONS`.
    """
    found: dict[str, Any] = {"seed": SEED, "plants": PLANTS, "budget": BUDGET, "matched": {}, "tuned": {}}
    means: dict[Column, float] = {}
    for column in COLUMNS:

        def weigh(column: Column = column) -> Sequence[float]:
            return matched(column, told)

        means[column], effort, share = _once(store, told, column, "matched", 2 + len(CONSTANTS), weigh)
        notes = "N; mean of |u| under compensation", f"N; effort {share:.3g} times that under compensation"
        _at(found["matched"], column)[column.start] = {
            key: _identified(float(f"{value:.4g}"), note)
            for key, value, note in zip(("mean", "effort"), (means[column], effort), notes, strict=True)
        }
    for column in TRAINED:
        _at(found["tuned"], column)[column.start] = both = {}
        for key, name in (("beta_1", BETA_1), ("beta_2", BETA_2)):

            def look(column: Column = column, name: str = name) -> Sequence[float]:
                tuned = search(column, name, means[column], told)
                return *tuned.value, tuned.evaluations, tuned.start, tuned.cost

            *value, evaluations, start, cost = _once(store, told, column, name, BUDGET, look)
            note = f"CMA-ES, {evaluations:.0f} evaluations; cost {start:.4g} at the start, {cost:.4g} in the end"
            both[key] = _identified(value, note)
    return found


def _once(
    store: Store, told: Told, column: Column, what: str, work: int, find: Callable[[], Sequence[float]]
) -> list[float]:
    """What is found, or kept from before."""
    settings = column.place().model_dump(mode="json")
    key = digest(["settling", what, settings, SEED, PLANTS, BUDGET, LEVEL, CONSTANTS.tolist()])
    if (kept := store.read(key)) is not None:
        told(work)
        return kept["found"].tolist()  # type: ignore[no-any-return]
    found = [float(value) for value in find()]
    store.write(key, {"found": np.array(found)})
    return found


def _at(tree: dict[str, Any], column: Column) -> dict[str, Any]:
    inner: dict[str, Any] = tree.setdefault(column.scenario, {}).setdefault(column.controller, {})
    return inner


def _identified(value: Any, note: str) -> dict[str, Any]:
    return {"value": value, "source": "identified", "note": note}
