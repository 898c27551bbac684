"""All laws, tuned alike: what they make of the plant on estimates, with and without a disturbance.

    smo-gym laws                                        # everything; half an hour on two cores
    smo-gym laws --case upright --observer ekf --sensor noise --period 0.02
    smo-gym laws --front --figure --workers 2           # tuned for smoother and for rougher forces; ten minutes
    smo-gym laws --promise --runs 1000                  # where the theorem's conditions hold, and where one is broken

Prints a part of it, and writes all of it to --out: mean squares, force and failures, with 95 % intervals over runs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import astuple, fields
from functools import partial
from importlib.util import find_spec

from tqdm import tqdm

from .. import files
from ..evaluation import formats, law_settings
from ..evaluation.law_cases import ESTIMATES, LEARNING, PERIODS, SENSORS, cases
from ..evaluation.law_settings import Laws
from ..evaluation.law_table import Cell, Row, cells, measured, row
from ..evaluation.report import figures, law_panels, table_page
from ..evaluation.report.table_page import Origin, Table
from ..evaluation.store import digest
from ..typing import Array
from . import computing
from .arguments import Parser, one_of, several, versions
from .entry import command, typed
from .laws_besides import front, promised

RESULTS = ("laws.csv", "laws.md")
FIGURE, PAGE = "laws", "laws.html"


@command("laws")
def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    parser = Parser("laws", __doc__)
    observers, places = (
        list(dict.fromkeys(each.observer for each in ESTIMATES)),
        [name for name, case in cases().items() if case.family != LEARNING],
    )
    parser.add_argument("--law", default=None, metavar="NAME", help="some of them (default: all)", **several(str))
    for name, known, default in (
        ("observer", observers, observers),
        ("case", places, places),
        ("sensor", [*SENSORS], [*SENSORS]),
        ("period", [f"{period:g}" for period in PERIODS], [f"{period:g}" for period in PERIODS]),
    ):
        told = f"of {', '.join(known)} (default: all)"
        parser.add_argument(f"--{name}", default=default, metavar="NAME", help=told, **several(one_of(name, known)))
    parser.add_argument(
        "--outside",
        action="store_true",
        help="plants uncertain by 35 %% and another disturbance, which nothing was tuned on",
    )
    parser.add_argument("--front", action="store_true", help="instead, what a smoother force costs each law")
    parser.add_argument("--promise", action="store_true", help="instead, what the integral sliding mode promises")
    parser.runs(200, "random plants in each cell")
    parser.seed("the random plants, starts and noise")
    parser.add_argument("--figure", action="store_true", help="draw it, as PDF and PNG into DIR")
    parser.add_argument("--report", action="store_true", help=f"write tables that sort and the picture into DIR/{PAGE}")
    parser.out("laws")
    computing.add(parser)
    args = parser.parse_args(arguments)
    if args.promise:
        return promised(args.runs, args.seed)
    if args.report:
        table_page.check()
    laws = law_settings.named()
    if args.front:
        return front(args, laws)
    periods, names = [float(period) for period in args.period], [*(args.law or laws.laws)]
    if args.law is None and not find_spec("osqp"):
        names = [name for name in names if laws[name].law != "mpc"]
        print('MPC is left out: it needs the extra mpc, pip install "smo_gym[mpc]"', file=sys.stderr)
    wanted = cells(laws, names, args.observer, args.case, args.sensor, periods, args.runs, args.seed, args.outside)
    if not wanted:
        raise ValueError(f"--law {' '.join(args.law or [])} has no gains for --case {' '.join(args.case)} there")
    drawings = [f"{FIGURE}.{form}" for form in figures.FORMATS] if args.figure else []
    with files.claimed(args.out, (*RESULTS, PAGE, *drawings)) as out, computing.working(args, out) as (mapped, store):
        keys = {cell: _key(laws, cell) for cell in wanted}
        rows = {cell: row(cell, kept) for cell in wanted if (kept := store.read(keys[cell])) is not None}
        left = [cell for cell in wanted if cell not in rows]
        with tqdm(total=len(wanted), unit="cell", desc="laws", leave=False, disable=None) as bar:
            bar.update(len(rows))
            for cell, found in mapped(partial(_cell, laws), left):
                store.write(keys[cell], found)
                rows[cell] = row(cell, found)
                bar.update()
        ordered = [rows[cell] for cell in wanted]
        made: dict[str, str | bytes] = {
            RESULTS[0]: formats.as_csv([field.name for field in fields(Row)], map(astuple, ordered)),
            RESULTS[1]: table_page.text(_tables(laws, ordered), "github") + "\n",
        }
        titles = {name: law.title for name, law in laws.laws.items()}
        kinds = {name: law.kind for name, law in laws.laws.items()}
        if args.report:
            tables, origin = _tables(laws, ordered), Origin(typed("laws", arguments), versions(), _sources(laws))
            drawn = {CAPTION: law_panels.draw(ordered, titles, kinds)}
            made[PAGE] = table_page.render("Laws on estimates", _TOLD, tables, drawn, origin)
        if args.figure:
            figure = law_panels.draw(ordered, titles, kinds)
            made |= {f"{FIGURE}.{form}": figures.encode(figure, form) for form in figures.FORMATS}
        try:
            files.write_set(out, made, [PAGE])
        finally:  # what cannot be written can be read at least
            print(table_page.text(_tables(laws, ordered), "simple"))
    print(f"\nresults are in {args.out}")
    return 0


_TOLD = (
    "Means over the random plants that did not fail, with 95 % intervals (Student's); a run that failed is counted. TV "
    "is the total variation of the force, from 0. All laws were tuned with the same budget on other plants."
)
CAPTION = "Errors against the force's total variation, on the filter's estimate behind noise, every 20 ms."


def _sources(laws: Laws) -> dict[str, object]:
    """What was tuned, by law and family."""
    return {
        name: {family: each.model_dump(mode="json") for family, each in law.tuned.items()}
        for name, law in laws.laws.items()
        if law.tuned
    }


def _key(laws: Laws, cell: Cell) -> str:
    return digest(["laws", laws.model_dump(mode="json"), repr(cell)])


def _cell(laws: Laws, cell: Cell) -> tuple[Cell, dict[str, Array]]:
    return cell, measured(laws, cell)


_SHOWN = (
    ("table-4", "no", "printed", "zero", "exact", 0.001),
    ("table-4", "no", "printed", "zero", "exact", 0.02),
    ("table-5-1", "no", "printed", "zero", "exact", 0.02),
    ("table-4", "no", "ekf", "measured", "noise", 0.02),
    ("table-4", "yes", "ekf", "measured", "counts", 0.02),
    ("upright", "yes", "ekf", "measured", "noise", 0.02),
    ("upright", "yes", "constant", "measured", "counts", 0.02),
    ("tracking", "no", "printed", "zero", "exact", 0.001),
    ("tracking", "no", "ekf", "measured", "noise", 0.02),
)
"""What the console shows: case, disturbed, observer, its start, sensor, control period."""


def _tables(laws: Laws, rows: Sequence[Row]) -> list[Table]:
    """A table for each place that is shown, a law a line; of a choice that has none of these, for each that it has."""
    places = list(dict.fromkeys(_place(row) for row in rows))
    shown = [place for place in _SHOWN if place in places] or places
    found = []
    for place in shown:
        mine = [row for row in rows if _place(row) == place or (row.law == "lqg" and _like(row, place))]
        lines = [
            (
                laws[row.law].title,
                f"{row.mse_h:.3g} ± {_half(row.mse_h_low, row.mse_h_high):.1g}",
                f"{row.mse_theta:.3g} ± {_half(row.mse_theta_low, row.mse_theta_high):.1g}",
                f"{row.effort:,.0f}",
                f"{row.total_variation:,.0f}",
                f"{row.late_variation:,.1f}",
                f"{row.peak_force:.0f}",
                f"{row.failures} of {row.runs}",
            )
            for row in mine
        ]
        header = (
            "law",
            "MSE h, m²",
            "MSE theta, rad²",
            "effort, N² s",
            "TV, N",
            "in the last 5 s",
            "peak, N",
            "failed",
        )
        case, disturbed, observer, start, sensor, period = place
        pushed = "disturbed, with friction" if disturbed == "yes" else "undisturbed"
        title = f"{case}, {pushed}: {observer} from {start}, sensor {sensor}, {1e3 * period:g} ms"
        found.append(Table(title, header, lines))
    return found


def _place(row: Row) -> tuple[str, str, str, str, str, float]:
    return row.case, row.disturbed, row.observer, row.start, row.sensor, row.control_period


def _like(row: Row, place: tuple[str, str, str, str, str, float]) -> bool:
    """Whether a row, but for its observer, stands where the filter does."""
    return place[2] == "ekf" and (*_place(row)[:2], "ekf", *_place(row)[3:]) == place


def _half(low: float, high: float) -> float:
    return 0.5 * (high - low)
