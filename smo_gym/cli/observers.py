"""All observers, tuned alike: on simulated encoders, or on recordings of real ones.

    smo-gym observers                        # sensors and levels, on the same trajectories and in the loop
    smo-gym observers --data DIR --out OUT   # recordings of two real rigs

Prints, and writes to --out, the errors of both velocities, with 95 % intervals over runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

from tqdm import tqdm

from .. import files
from ..evaluation import candidates, formats, observing, robustness, velocity_errors
from ..evaluation.observing import Row
from ..evaluation.report import figures, observer_panels, table_page
from ..evaluation.report.table_page import Origin, Table
from ..evaluation.store import FOLDER, Store
from ..evaluation.study import simulated_seconds
from . import computing, real
from .arguments import Parser, one_of, several, versions
from .entry import command, typed

PLACE = {"environment", "horizon", "force_limit", "track_limit", "control_period", "uncertainty", "initial_states"}
"""Settings of the scenario that a page tells."""
RESULTS = ("observers.csv", "observers.md")
FIGURE = "observers"


@command("observers")
def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    parser = Parser("observers", __doc__)
    parser.add_argument("--data", type=Path, metavar="DIR", help="recordings, a folder or file (default: simulated)")
    parser.add_argument("--observer", default=None, metavar="NAME", help="some of them (default: all)", **several(str))
    parser.add_argument(
        "--sensor",
        default=[*observing.SENSORS],
        metavar="NAME",
        help=f"of {', '.join(observing.SENSORS)} (default: all)",
        **several(one_of("sensor", [*observing.SENSORS])),
    )
    parser.runs(200, "random plants at each level of uncertainty")
    parser.seed("the random plants and noise")
    parser.add_argument("--figure", action="store_true", help="draw it, as PDF and PNG into DIR")
    parser.add_argument(
        "--report", action="store_true", help=f"write tables that sort and the picture into DIR/{real.PAGE}"
    )
    parser.add_argument("--mismatch", action="store_true", help="with --data: wrong models, all observers tuned again")
    parser.out("observers")
    computing.add(parser)
    args = parser.parse_args(arguments)
    if args.mismatch and args.data is None:
        raise ValueError("--mismatch is of recordings: give their folder with --data")
    if args.report:
        table_page.check()
    line = typed("observers", arguments)
    return _simulated(args, line) if args.data is None else real.measure(args, line)


def chosen(known: candidates.Candidates, names: Sequence[str] | None) -> dict[str, candidates.Candidate]:
    """Some candidates, or all.

    Raises:
        ValueError: there is none of a name.
    """
    return {name: known[name] for name in names or known.observers}


def _simulated(args: argparse.Namespace, line: str) -> int:
    observers = chosen(candidates.named("simulated"), args.observer)
    drawings = [f"{FIGURE}.{form}" for form in figures.FORMATS] if args.figure else []
    groups = observing.wanted([*observers], args.sensor, observing.LEVELS, args.runs)
    with (
        files.claimed(args.out, (*RESULTS, real.PAGE, *drawings)) as out,
        computing.computing(args, out) as measure,
        robustness.late_errors(),
    ):
        seconds = args.runs * observing.HORIZON
        total = simulated_seconds(groups) + len(groups) * seconds
        with tqdm(total=total, unit="s", unit_scale=True, desc="simulated", leave=False, disable=None) as bar:
            rows = [
                *observing.open_loop(
                    observers,
                    args.sensor,
                    observing.LEVELS,
                    args.runs,
                    args.seed,
                    Store(out / FOLDER),
                    lambda done: bar.update(done * seconds),
                )
            ]
            outcomes = measure(groups, args.seed, bar.update)
        sensors = [sensor for sensor in args.sensor for _ in observing.LEVELS for _ in observers]
        for sensor, outcome in zip(sensors, outcomes, strict=True):
            rows += observing.closed(sensor, outcome)
        speed = {name: observing.nanoseconds(candidate) for name, candidate in observers.items()}
        made: dict[str, str | bytes] = {
            RESULTS[0]: _csv(rows, speed),
            RESULTS[1]: table_page.text(_tables(rows, speed), "github") + "\n",
        }
        if args.figure:
            figure = observer_panels.draw(rows, [*observers], observing.LEVELS[-1])
            made |= {f"{FIGURE}.{form}": figures.encode(figure, form) for form in figures.FORMATS}
        if args.report:
            made[real.PAGE] = _page(args, observers, rows, speed, line)
        try:
            files.write_set(out, made, [real.PAGE])
        finally:  # what cannot be written can be read at least
            print(table_page.text(_tables(rows, speed), "simple"))
    print(f"\nresults are in {args.out}")
    return 0


def _csv(rows: Sequence[Row], speed: dict[str, float]) -> str:
    header = [*(field.name for field in fields(Row)), "ns"]
    return formats.as_csv(header, [(*astuple(row), speed[row.observer]) for row in rows])


def _tables(rows: Sequence[Row], speed: dict[str, float]) -> list[Table]:
    """A table for each loop at the largest level."""
    level = max(row.uncertainty for row in rows)
    return [
        _table(
            f"Plants uncertain by {level:.0%}, {title}",
            [row for row in rows if (row.loop, row.uncertainty) == (loop, level)],
            speed,
        )
        for loop, title in (
            ("open", "on the same trajectories: RMS errors of h' in m/s and theta' in rad/s after 2 s"),
            ("closed", f"each in the loop of {observing.LAW.upper()}: the same, and runs that failed"),
        )
    ]


def _table(title: str, rows: Sequence[Row], speed: dict[str, float]) -> Table:
    """An observer a line, a sensor a column."""
    sensors = list(dict.fromkeys(row.sensor for row in rows))
    lines = [
        (
            name,
            *(_cell([row for row in rows if (row.observer, row.sensor) == (name, s)]) for s in sensors),
            f"{speed[name]:.0f}",
        )
        for name in dict.fromkeys(row.observer for row in rows)
    ]
    return Table(title, ("observer", *sensors, "ns"), lines)


def _cell(rows: Sequence[Row]) -> str:
    """Errors of the velocities, and how many runs failed where some did."""
    errors = " / ".join(f"{row.rmse:.2g}" for row in rows)
    return errors + (f" ({rows[0].failed} lost)" if rows[0].failed else "")


def _page(
    args: argparse.Namespace,
    observers: dict[str, candidates.Candidate],
    rows: Sequence[Row],
    speed: dict[str, float],
    line: str,
) -> str:
    """The tables, of each velocity one, so that all numbers sort; and the picture, which needs both of its sensors."""
    level = observing.LEVELS[-1]
    tables = [
        _table(
            f"{where}, {title}: RMS error in {unit} behind each sensor; ns: time for a slot and sample",
            [row for row in rows if (row.loop, row.channel, row.uncertainty) == (loop, channel, level)],
            speed,
        )
        for loop, where in (("open", "Open loop"), ("closed", "Closed loop"))
        for (channel, title), unit in zip(observer_panels.TITLES.items(), ("m/s", "rad/s"), strict=True)
    ]
    caption = "What noise adds to each velocity against its lag, in the open loop. Blue: none is better in both."
    drawn = {observing.EXACT, observing.NOISE} <= {*args.sensor}
    settings = {
        **observing.place(observing.EXACT).model_dump(mode="json", include=PLACE),
        "sensor": {
            name: {"value": observing.SENSORS[name] or "none", "source": "chosen", "note": ""} for name in args.sensor
        },
        **candidates.told(observers),
    }
    return table_page.render(
        "Observers on simulated encoders",
        f"{args.runs} random plants, uncertain by {100 * level:g} %, seed {args.seed}; {RESULTS[0]} has the smaller "
        f"levels too. In the open loop {observing.LAW.upper()} acts on the true state, and all observers see the same "
        "trajectories; in the closed loop it acts on the observer's estimate. Errors are of the last "
        f"{observing.HORIZON - velocity_errors.SETTLED:g} of {observing.HORIZON:g} s, in runs that did not fail; "
        "those that did are counted beside.",
        tables,
        {caption: observer_panels.draw(rows, [*observers], level)} if drawn else {},
        Origin(line, versions(), settings),
    )
