"""What ``smo-gym identify`` says by likelihoods: of Table 5's level, of (26), and of what may stand behind Table 7."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from tabulate import tabulate
from tqdm import tqdm

from ..evaluation import scenario
from ..evaluation.arms import PRINTED
from ..evaluation.identify import table7
from ..evaluation.identify.runs import STATES
from ..evaluation.identify.search import Search, cost
from ..evaluation.identify.table5 import PARAMETERS, Table5, hold_out
from ..typing import Array

STATE = "state.json"
Costs = Sequence[Sequence[float]]
Save = Callable[[Sequence[Search]], None]
Report = tuple[str, dict[str, Any]]
LEVELS = (0.05, 0.07, 0.10, 0.12, 0.15, 0.18, 0.20)
ERRORS = (0.0, 0.02, 0.03)
PLANTS = 200
"""Random plants behind every mean that is reported."""


def level(args: Namespace, costs: Sequence[Costs], save: Save) -> Report:
    """How likely each level of uncertainty makes Table 5's LQR cells, and LQR's gain at the lowest and highest."""
    table = Table5(scenario.named("initial-conditions"))
    told = [table.at_level(x, PLANTS) for x in tqdm(LEVELS, desc="levels", leave=False, disable=None)]
    held = np.array([[each.log_likelihood(table.printed, error) for error in ERRORS] for each in told])
    fitted = [[table.gains(each, error) for error in ERRORS] for each in told]
    evidence = np.array([[found.log_evidence for found in row] for row in fitted])
    rows = [
        (f"{100 * x:g} %", *(f"{number:.1f}" for number in (*a, *b)))
        for x, a, b in zip(LEVELS, held - held.max(), evidence - evidence.max(), strict=True)
    ]
    errors = [f"{100 * error:g} %" for error in ERRORS]
    header = ("level", *(f"held, {e}" for e in errors), *(f"fitted, {e}" for e in errors))
    usual = [*table.K, *table.slopes]
    gains = [
        (
            f"{100 * LEVELS[i]:g} %",
            *(
                f"{value * np.exp(shift):.4g}, {100 * sd:.1f} %"
                for value, shift, sd in zip(usual, found.shift, np.sqrt(np.diag(found.covariance)), strict=True)
            ),
        )
        for i in (0, -1)
        for found in [fitted[i][1]]
    ]
    text = [
        "# Table 5's level of uncertainty",
        "Log likelihood of the sixteen LQR cells, less the largest of its half: with the settings of configs/ held, "
        f"and over all values of gain and slopes (fitted); with a model's error of {', '.join(errors)} in every cell. "
        f"Means of ten runs, from {PLANTS} plants a level.",
        tabulate(rows, header, tablefmt="github", disable_numparse=True),
        f"## LQR's gain and the observer's slopes: value, standard deviation ({errors[1]} model's error, Laplace)",
        tabulate(gains, ("level", *PARAMETERS), tablefmt="github", disable_numparse=True),
    ]
    data = {"levels": LEVELS, "errors": ERRORS, "held": held.tolist(), "fitted": evidence.tolist()}
    return "\n\n".join(text) + "\n", data


def rivals(args: Namespace, costs: Sequence[Costs], save: Save) -> Report:
    """(34) and (26), each fitted to two cases of Table 5 and to all, and what it then says of the others."""
    place = scenario.named("initial-conditions")
    found = [
        held
        for equation in tqdm(("34", "26"), desc="equations", leave=False, disable=None)
        for table in [Table5(place, equation)]
        for held in hold_out(table, args.restarts, args.seed)
    ]
    rows = [
        (
            f"({each.equation})",
            ", ".join(each.fitted),
            f"{100 * each.inside:.1f}",
            f"{100 * each.outside:.1f}" if np.isfinite(each.outside) else "",
        )
        for each in found
    ]
    text = [
        "# Equation (34) or (26)",
        "LQR's gain and the observer's slopes, six numbers, fitted to all LQR cells of Table 5 (the best of "
        f"{args.restarts} starts), and from there to the eight of two cases; RMS of log(measured/published) there and "
        "over the other two, on the nominal plant.",
        tabulate(rows, ("", "fitted to cases", "RMS, %", "of the others, %"), tablefmt="github", disable_numparse=True),
    ]
    return "\n\n".join(text) + "\n", {"rows": rows}


def structures(args: Namespace, costs: Sequence[Costs], save: Save) -> Report:
    """What may stand behind Table 7, each with its likeliest parameters; saved after every generation."""
    place = scenario.named("tracking")
    tried = table7.structures(place)
    known = [*costs, *([()] * (len(tried) - len(costs)))]
    searches: list[Search] = []
    points: list[tuple[table7.Structure, Array]] = []
    with tqdm(total=args.generations * (len(tried) + 1), desc="generations", leave=False, disable=None) as bar:
        for each, known_costs in zip(tried, known, strict=True):
            k = [point for _, point in points[:1]]  # that of the first structure, which the others contain
            start = np.concatenate([*k, each.start[4 * len(k) :]])
            try:
                search = Search(each, each.hypothesis, args.seed, start, costs=known_costs)
            except (ValueError, TypeError) as error:
                raise damaged(args, error) from None
            searches.append(search)
            bar.update(search.generations)
            while search.generations < args.generations * (2 if each is tried[0] else 1):
                search.step()
                save(searches)
                bar.set_postfix_str(f"{each.name}: perplexity {search.rms:.3g}")
                bar.update()
            found = float(cost(each, start[None], each.hypothesis)[0])
            points.append((each, search.best if search.rms < found else start))
    usual = table7.Structure(place, "as in configs/", {})
    judged = [(each, point, table7.verdict(each, point, PLANTS)) for each, point in [(usual, usual.start), *points]]
    rows: list[tuple[str, ...]] = [
        (
            each.name,
            ", ".join(f"{name} {value:.3g}" for name, value in zip(each.parameters, 10.0**point, strict=True)),
            f"{found.log_likelihood:.1f}",
            f"{found.near} of {found.cells}",
            f"{found.ceiling:.1f}",
            *(f"{ratio:.2f}" for ratio in found.scatter),
        )
        for each, point, found in judged
    ]
    likelihood, near, cells = table7.of_columns(place)
    rows.append(("a mean and a scatter for each column", "8 numbers", f"{likelihood:.1f}", f"{near} of {cells}"))
    scatter = [f"scatter, {state} {arm}" for arm in PRINTED for state in STATES]
    header = ("structure", "parameters", "log likelihood", "within 10 %", "ceiling", *scatter)
    text = [
        "# Structures behind Table 7",
        f"{2 * args.generations} generations of 12 candidates for k, from the settings in configs/, and "
        f"{args.generations} for each other structure, from the k found; on {table7.PLANTS} plants a level, for the "
        f"likelihood of the 24 cells with a model's error of {100 * table7.ERROR:g} %. Then each is judged on {PLANTS} "
        "other plants a level. Scatter: the standard deviation of means of ten runs, over that of the printed cells "
        "over the six levels.",
        tabulate(rows, header, tablefmt="github", disable_numparse=True),
    ]
    return "\n\n".join(text) + "\n", {"rows": rows}


def damaged(args: Namespace, error: Exception) -> ValueError:
    """That the state of an interrupted run is of no such searches."""
    return ValueError(f"{args.out / STATE} is damaged ({error}): remove it to start anew")


LIKELIHOODS: dict[str, Callable[[Namespace, Sequence[Costs], Save], Report]] = {
    "level": level,
    "rivals": rivals,
    "structures": structures,
}
