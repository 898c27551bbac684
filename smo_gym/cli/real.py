"""Observers on recordings of real rigs, on a command line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import astuple, fields
from typing import Any

from tqdm import tqdm

from .. import files
from ..evaluation import candidates, formats, on_recordings, real_sweeps
from ..evaluation.candidates import Candidate, Candidates
from ..evaluation.on_recordings import Row, Runs
from ..evaluation.real_sweeps import Lost, Mistaken
from ..evaluation.report import fault_panels, figures, table_page
from ..evaluation.report.table_page import Origin, Table
from ..evaluation.store import digest, kept
from ..observers import SlidingModeObserver
from ..recordings import CART_POLE, RIGS, load, smoothing
from ..recordings.loading import holds
from .arguments import versions
from .entry import Stop

RESULTS = ("real.csv", "lost.csv", "mismatch.csv", "real.md")
FIGURE = "fault"
PAGE = "observers.html"
TOLD = (
    "Each observer runs through the test recordings, which its numbers were not tuned on. No true velocity is "
    "known: errors are told against that of a smoother, which sees the whole recording. Nothing is random but the "
    "resampling of runs for the intervals, whose seed is fixed. ns is the time for a sample."
)
CAPTION = "A passage of the sensor's fault: what it reads, and how far off the speed of some observers is meanwhile."
SMO = "smo"


def measure(args: argparse.Namespace, line: str) -> int:
    """Measure all rigs of a folder; 0 when all went well.

    Args:
        args: of ``smo-gym observers``.
        line: that makes the results again.
    """
    found = {rig.name: load(rig, args.data, "test") for rig in RIGS.values() if holds(rig, args.data)}
    if not found:
        raise ValueError(f"--data {args.data}: has no folder of {' or '.join(RIGS)}, and no *.csv")
    drawings = [f"{FIGURE}.{form}" for form in figures.FORMATS] if args.figure else []
    rows: list[Row] = []
    lost: list[Lost] = []
    mistaken: list[Mistaken] = []
    used: dict[str, Any] = {}
    figure: Any = None
    with files.claimed(args.out, (*RESULTS, PAGE, *drawings)) as out, kept(out) as store:
        try:
            for name, recordings in found.items():
                settings = candidates.named(name)
                observers = {each: settings[each] for each in args.observer or settings.observers}
                used[name] = candidates.told(observers)
                runs = Runs.of(RIGS[name], recordings)
                with tqdm(total=len(observers), unit="observer", desc=name, leave=False, disable=None) as bar:
                    rows += on_recordings.rows(runs, observers, bar.update)
                if SMO in observers and name == CART_POLE.name:
                    smo = settings[SMO].build(RIGS[name].model)
                    assert isinstance(smo, SlidingModeObserver)
                    lost += real_sweeps.lost(runs, smo)
                if args.mismatch and name == CART_POLE.name:
                    mistaken += _mistaken(args, settings, [*observers], runs, store)
                if (args.figure or args.report) and figure is None and any(each.fault.any() for each in recordings):
                    figure = fault_panels.draw(runs, observers)
        except KeyboardInterrupt:
            raise Stop(f"interrupted; the same command goes on from what is in {out}") from None
        tables = [_table(rig, rows) for rig in found] + _sweeps(lost, mistaken)
        made: dict[str, str | bytes] = {
            RESULTS[0]: _csv(Row, rows, leave="each"),
            RESULTS[3]: table_page.text(tables, "github") + "\n",
        }
        if lost:
            made[RESULTS[1]] = _csv(Lost, lost)
        if mistaken:
            made[RESULTS[2]] = _csv(Mistaken, mistaken)
        if figure is not None and args.figure:
            made |= {f"{FIGURE}.{form}": figures.encode(figure, form) for form in figures.FORMATS}
        if args.report:
            made[PAGE] = table_page.render(
                "Observers on recordings of real rigs",
                TOLD,
                tables,
                {} if figure is None else {CAPTION: figure},
                Origin(line, versions(), used),
            )
        try:
            files.write_set(out, made, [PAGE])
        finally:  # what cannot be written can be read at least
            print(table_page.text(tables, "simple"))
    print(f"\nresults are in {args.out}")
    return 0


def _mistaken(
    args: argparse.Namespace, settings: Candidates, names: Sequence[str], test: Runs, store: Any
) -> list[Mistaken]:
    train = Runs.of(test.rig, load(test.rig, args.data, "train"))

    def remembered(candidate: Candidate, mismatch: str, make: Any) -> Any:
        assert candidate.tuned is not None
        key = digest(["mismatch", candidate.model_dump(mode="json"), mismatch, settings.seed, settings.scales])
        if (done := store.read(key)) is not None:
            return candidates.with_leaves(candidate.tuned.value, iter(done["value"].tolist()))
        tuned = make()
        store.write(key, {"value": [number for _, number in candidates.leaves(tuned)]})
        return tuned

    total = len(real_sweeps.MISMATCHES) * len(names)
    with tqdm(total=total, unit="observer", desc="wrong models", leave=False, disable=None) as bar:
        return [*real_sweeps.mistaken(train, test, settings, names, bar.update, remembered)]


def _csv(kind: type, rows: Sequence[Any], leave: str = "") -> str:
    names = [field.name for field in fields(kind)]
    keep = [i for i, name in enumerate(names) if name != leave]
    return formats.as_csv([names[i] for i in keep], [[astuple(row)[i] for i in keep] for row in rows])


def _table(rig: str, rows: Sequence[Row]) -> Table:
    """An observer a line, against the smoother with the model; of the other references the errors alone."""
    mine = [row for row in rows if row.rig == rig]
    first, second = RIGS[rig].channels
    of = {(row.observer, row.channel, row.reference): row for row in mine}
    lines = []
    for name in dict.fromkeys(row.observer for row in mine):
        a, b = (of[name, channel, smoothing.MODEL] for channel in (first, second))
        others = [of[name, channel, smoothing.POLYNOMIAL].rmse for channel in (first, second)]
        fault = f"{b.fault_median:.2f} / {b.fault_largest:.2f}" if b.fault_median == b.fault_median else "-"
        lines.append(
            (
                name,
                f"{a.rmse:.4f} [{a.ci_low:.4f}, {a.ci_high:.4f}]",
                f"{b.rmse:.3f} [{b.ci_low:.3f}, {b.ci_high:.3f}]",
                f"{a.lag_ms:.1f} / {b.lag_ms:.1f}",
                f"{b.largest:.2f}",
                fault,
                f"{b.lost} of {b.runs}",
                f"{others[0]:.4f} / {others[1]:.3f}",
                f"{a.ns:.0f}",
            )
        )
    units = RIGS[rig].units
    header = (
        "observer",
        f"{first}, {units[0]}",
        f"{second}, {units[1]}",
        "lag, ms",
        "largest",
        "fault",
        "lost",
        "SG",
        "ns",
    )
    title = (
        f"{rig}: RMS errors and their 95 % intervals over {mine[0].runs} runs, reference: smoother with the model\n"
        "(fault: median and largest peak where the sensor says nothing; SG: against Savitzky and Golay)"
    )
    return Table(title, header, lines)


def _sweeps(lost: Sequence[Lost], mistaken: Sequence[Mistaken]) -> list[Table]:
    found = []
    if lost:
        lines = [
            (
                f"{cold.gain} = {cold.value:g}",
                f"{cold.holds} of {cold.runs}",
                cold.lost,
                warm.lost,
                f"{cold.rmse:.3f}",
                f"{warm.rmse:.3f}",
            )
            for cold, warm in zip(lost[::2], lost[1::2], strict=True)
        ]
        header = ("gain of the pole", "its condition holds", "lost, cold start", "warm", "RMS, cold", "warm")
        title = "The article's observer on the cart pole: runs lost over (28)'s m1 and (30)'s beta_1"
        found.append(Table(title, header, lines))
    if mistaken:
        of = {(row.mismatch, row.observer, row.retuned, row.channel): row.rmse for row in mistaken}
        names = list(dict.fromkeys(row.observer for row in mistaken))
        first, second = dict.fromkeys(row.channel for row in mistaken)
        wrong: list[tuple[str, ...]] = []
        for name in names:
            cells = []
            for mismatch in real_sweeps.MISMATCHES:
                again = (mismatch, name, True) if (mismatch, name, True, first) in of else (mismatch, name, False)
                pole = (of[(mismatch, name, False, second)], of[(*again, second)])
                cells.append(f"{of[(*again, first)]:.3f} / {pole[0]:.2f} > {pole[1]:.3f}")
            wrong.append((name, *cells))
        title = "Wrong models: cart m/s tuned again / pole rad/s as tuned for the right model > tuned again"
        found.append(Table(title, ("observer", *real_sweeps.MISMATCHES), wrong))
    return found
