"""The article's scheme with real encoders, and under a push that its model has not.

    smo-gym robustness

Prints, and writes to --out, what sensors do to every observer's estimate and to LQR and SMC on it, and the largest
constant push on the cart under which none of the upright plants falls.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from tabulate import tabulate
from tqdm import tqdm

from .. import files
from ..evaluation import configs, formats, robustness, scenario, store, study
from ..evaluation.arms import ARMS
from ..evaluation.report import figures, robust_panels
from ..evaluation.robustness import COLUMNS, Push, Row
from ..observers import Gains
from ..theorem import design, suprema
from .arguments import Parser, whole
from .entry import Stop, command
from .progress import simulated

CASES = ("theta(0) = 0.2", "theta(0) = 0.3")
LAWS = ("lqr", "smc")
RESULTS = ("sensors.csv", "pushes.csv", "robustness.md")
FIGURE = "robustness"
PUSH = 1.0
"""Newtons of disturbance in the condition (30) that is printed."""
_SHORT = ("h', m/s", "theta', rad/s", "MSE h", "theta", "effort", "TV, N", "peak, N")


@command("robustness")
def main(arguments: Sequence[str] | None = None) -> int:
    """Measure; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    parser = Parser("robustness", __doc__)
    parser.runs(200, "random plants a row of the table of sensors")
    parser.add_argument("--plants", type=whole(2), default=1000, metavar="N", help="upright plants (default 1000)")
    parser.seed("the random plants")
    parser.add_argument("--figure", action="store_true", help="draw it, as PDF and PNG into DIR")
    parser.out("robustness")
    args = parser.parse_args(arguments)
    drawings = [f"{FIGURE}.{form}" for form in figures.FORMATS] if args.figure else []
    place, upright = scenario.named("regulation").from_one_start(), scenario.named("upright")
    with files.claimed(args.out, (*RESULTS, *drawings)) as out:
        try:
            with store.kept(out) as kept:
                measured = partial(study.measure, store=kept)
                rows = _sensors(place, args.runs, args.seed, measured)
                with tqdm(desc="pushes", unit="round", leave=False, disable=None) as bar:
                    pushes = [
                        push
                        for case in CASES
                        for push in robustness.largest_pushes(
                            upright, case, args.plants, args.seed, measured=measured, told=bar.update
                        )
                    ]
        except KeyboardInterrupt:
            raise Stop(f"interrupted; the same command goes on from what is in {out}") from None
        told = "\n\n".join(_said(rows, pushes, form="github"))
        made: dict[str, str | bytes] = dict(
            zip(RESULTS, (_rows_csv(rows), _pushes_csv(pushes), told + "\n"), strict=True)
        )
        if args.figure:
            figure = robust_panels.draw(rows, pushes)
            made |= {f"{FIGURE}.{form}": figures.encode(figure, form) for form in figures.FORMATS}
        try:
            files.write_set(out, made)
        finally:  # what cannot be written can be read at least
            print("\n\n".join(_said(rows, pushes, form="simple")))
    print(f"\nresults are in {args.out}")
    return 0


def _sensors(place: scenario.Scenario, runs: int, seed: int, measured: robustness.Measure) -> list[Row]:
    wanted = robustness.of_sensors(place, LAWS, runs)
    every = [group for some in wanted.values() for group in some]
    with robustness.late_errors(), simulated(every) as bar:
        outcomes = iter(measured(every, seed, bar.update))
        return [robustness.row(name, next(outcomes)) for name, some in wanted.items() for _ in some]


def _said(rows: Sequence[Row], pushes: Sequence[Push], form: str) -> list[str]:
    """All tables, each below its title, and what they say."""
    found = [_of_law(law, [row for row in rows if row.controller == law], form) for law in LAWS]
    first, *_ = ARMS
    lines = [
        (
            push.case.rpartition(" ")[2] if push.arm == first else "",
            ARMS[push.arm].title,
            f"{push.stood:.2f}" if math.isfinite(push.stood) else "none",
            f"{push.fell:.2f}",
            str(push.falls),
            _percent(push.surviving),
        )
        for push in pushes
    ]
    header = ("rad", "estimate", "all stand, N", "some fall, N", "so many", "share that stands it")
    title = (
        f"LQR upright, 20 %: the largest constant push that all of {pushes[0].runs} plants stand\n"
        "(and the share that stands the least push tried under which some fall: 95 %, Clopper and Pearson)"
    )
    words = _words(rows, pushes)
    told = textwrap.fill(words, formats.WIDTH) if form == "simple" else formats.paragraph(words, form)
    return [*found, _conditions(form), _table(title, lines, header, form), told]


def _percent(shares: Iterable[float]) -> str:
    return " to ".join(f"{100 * share:.3f}" for share in shares) + " %"


def _of_law(law: str, rows: Sequence[Row], form: str) -> str:
    first, *_ = ARMS
    lines = [
        (
            row.sensor if row.arm == first else "",
            f"{row.arm}, {row.failed} failed" if row.failed else row.arm,
            *(f"{row.means[name]:.3g}" for name in COLUMNS),
        )
        for row in rows
    ]
    title = (
        f"{law.upper()} from Table 4's start, 20 %: RMS errors of the velocities after 2 s, means over "
        f"{rows[0].runs} runs\n{robustness.MEANT}"
    )
    return _table(title, lines, ("sensor", "estimate", *_SHORT), form)


def _table(title: str, lines: Sequence[Sequence[str]], header: Sequence[str], form: str) -> str:
    return f"{title}\n\n{tabulate(lines, header, form, disable_numparse=True)}"


def _words(rows: Sequence[Row], pushes: Sequence[Push]) -> str:
    """What the tables say."""
    value = {(row.sensor, row.controller, row.arm): row.means for row in rows}
    exact, *_, worst = robustness.SENSORS
    error, chatter = "late_rms_theta_dot", "total_variation"
    calm, rough = (value[sensor, "lqr", "theorem"] for sensor in (exact, worst))
    printed = value[worst, "lqr", "with"][error]
    first, *_ = CASES
    mine = [push for push in pushes if push.case == first]
    held = {p.arm: f"{p.stood:.3g} N" if math.isfinite(p.stood) else "no push at all" for p in mine}
    return (
        f"With noise of 1 mm and 5 mrad the designed gains' error of theta' grows {rough[error] / calm[error]:.3g} "
        f"times under LQR, and the total variation of its force {rough[chatter] / calm[chatter]:.3g} times; with the "
        f"printed gains the error, {printed:.3g} rad/s, hardly changes: it was large before. Upright from "
        f"{first.rpartition(' ')[2]} rad, all plants stand {held['without']} without compensation, {held['with']} with "
        f"it, {held['theorem']} with the designed gains and {held['oracle']} on the true state."
    )


def _conditions(form: str) -> str:
    """Condition (30) without and with a push, for the printed gains and for those that are designed for it."""
    settings = scenario.load_theorem(configs.path("theorem"))
    calm = settings.over(scenario.named("regulation").task.params)
    pushed = replace(calm, push=PUSH)
    printed = Gains.of(scenario.named("regulation").controllers["lqr"].observer.build(True).gains)
    designed = {"designed without a push": calm, "designed for it": pushed}
    lines = []
    for over, disturbance in ((calm, "none"), (pushed, f"{PUSH:g} N")):
        drift = suprema(over).drift
        gains = {"printed": printed} | {
            name: design(meant, settings.margin.value)
            for name, meant in designed.items()
            if meant is calm or over is pushed
        }
        for name, some in gains.items():
            beta_1 = np.array(some.beta_1)
            lines.append((disturbance, name, _pair(drift), _pair(beta_1), _pair(beta_1 - drift)))
    header = ("push", "gains", "supremum of (30)", "beta_1", "margin, beta_1 less the supremum")
    title = "Condition (30) over the operating set of configs/theorem.yaml, rows h and theta"
    return _table(title, lines, header, form)


def _pair(values: Iterable[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def _rows_csv(rows: Sequence[Row]) -> str:
    header = ["sensor", "controller", "arm", "runs", "failed"]
    header += [f"{name}{end}" for name in COLUMNS for end in ("", "_ci_low", "_ci_high")]
    lines = [
        (
            *(row.sensor, row.controller, row.arm, row.runs, row.failed),
            *(part[name] for name in COLUMNS for part in (row.means, row.low, row.high)),
        )
        for row in rows
    ]
    return formats.as_csv(header, lines)


def _pushes_csv(pushes: Sequence[Push]) -> str:
    header = ["case", "arm", "all_stand_N", "some_fall_N", "falls", "runs", "share_at_most"]
    header += ["share_stands_ci_low", "share_stands_ci_high"]
    lines = [(p.case, p.arm, p.stood, p.fell, p.falls, p.runs, p.at_most, *p.surviving) for p in pushes]
    return formats.as_csv(header, lines)
