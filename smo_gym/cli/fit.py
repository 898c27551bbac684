"""Fit the model of a rig, and its noise, to its training recordings: each number with its standard error.

    smo-gym fit cartpole --data DIR
    smo-gym fit cartpole --data DIR --twin ekf smo      # and these observers on twins, whose truth is known
    smo-gym fit qube --data DIR --seconds 1 6
    smo-gym fit my_rig:RIG --data DIR --hold gain

The search begins at the rig's own numbers, friction among them. What its sensor's correction and its input's delay are
is not fitted. Standard errors are right where the model is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from tqdm import tqdm

from .. import files
from ..evaluation import candidates, formats, on_recordings
from ..evaluation.on_recordings import Row, Runs
from ..policies import named
from ..recordings import RIGS, Recording, Rig, load
from ..recordings.fitting import ROUNDS, Fit, fit, loss, numbers
from ..validation import unknown
from .arguments import Parser, real, several, whole
from .entry import command
from .observers import chosen

RESULTS = ("twins.csv", "fit.yaml")


@command("fit")
def main(arguments: Sequence[str] | None = None) -> int:
    """Fit; 0 when all went well, 2 for a bad argument or file, and where the fit does not converge."""
    parser = Parser("fit", __doc__)
    parser.add_argument("rig", metavar="RIG", help=f"{', '.join(RIGS)}, or module:NAME of your own")
    parser.add_argument("--data", type=Path, metavar="DIR", required=True, help="recordings, a folder or file")
    parser.add_argument("--seconds", type=real, nargs=2, metavar="S", help="of each, from and to (default: all)")
    parser.add_argument("--hold", default=[], metavar="NAME", help="numbers that are not fitted", **several(str))
    parser.add_argument("--rounds", type=whole(1), default=ROUNDS, metavar="N", help=f"of search (default {ROUNDS})")
    parser.add_argument(
        "--twin", metavar="OBSERVER", help="errors of some, or of all, on twins", **(several(str) | {"nargs": "*"})
    )
    parser.seed("the twins' noise")
    parser.out("fitted")
    args = parser.parse_args(arguments)
    rig = _rig(args.rig)
    observers = {} if args.twin is None else chosen(candidates.named(rig.name), args.twin)
    recordings = load(rig, args.data, "train")
    if args.seconds:
        recordings = tuple(each.between(*args.seconds) for each in recordings)
    with files.claimed(args.out, RESULTS) as out:
        with tqdm(unit="evaluation", desc="fitting", leave=False, disable=None) as bar:
            found = fit(rig, recordings, dict.fromkeys((*rig.held, *args.hold)), args.rounds, bar.update)
        told = _told(rig, found, recordings)
        made = {RESULTS[1]: yaml.safe_dump(told, sort_keys=False, width=120, default_flow_style=None)}
        rows: list[Row] = []
        if observers:
            with tqdm(total=len(observers), unit="observer", desc="twins", leave=False, disable=None) as bar:
                rows += on_recordings.rows(Runs.twins(found.rig, recordings, args.seed), observers, bar.update)
            made = {RESULTS[0]: _csv(rows)} | made
        files.write_set(out, made, RESULTS)
    print(_table(told["numbers"]))
    print(
        f"\nrecordings: {told['recordings']}, samples: {told['samples']}; -log of the likelihood for each measurement "
        f"{told['loss']:.4f}, with the shipped numbers {told['shipped_loss']:.4f}"
    )
    if rows:
        print(f"\n{_errors(found.rig, rows)}")
    print(f"\nresults are in {args.out}")
    return 0


def _rig(text: str) -> Rig:
    """A rig by name, or one of the user's own.

    Raises:
        ValueError: it is neither.
    """
    if text in RIGS:
        return RIGS[text]
    if ":" not in text:
        raise ValueError(f"{unknown('rig', text, RIGS)}, or module:NAME")
    module, _, name = text.partition(":")
    found = getattr(named.imported(module), name, None)
    if not isinstance(found, Rig):
        raise ValueError(f"{text}: must name a smo_gym.recordings.Rig, it is {found!r}")
    return found


def _told(rig: Rig, found: Fit, recordings: Sequence[Recording]) -> dict[str, Any]:
    """What was found, as it is written: the error of a number that was held is null."""
    errors = dict(zip(found.names, found.errors.tolist(), strict=True))
    shipped = numbers(rig)
    return {
        "rig": rig.name,
        "recordings": len(recordings),
        "samples": sum(len(each.t) for each in recordings),
        "evaluations": found.evaluations,
        "loss": found.loss,
        "shipped_loss": loss(rig, recordings),
        "numbers": {
            name: {"value": value, "error": errors.get(name), "shipped": shipped[name]}
            for name, value in numbers(found.rig).items()
        },
    }


def _table(told: dict[str, dict[str, Any]]) -> str:
    lines = []
    for name, of in told.items():
        error, away = "held", ""
        if of["error"] is not None:
            error, away = f"{of['error']:.2g}", f"{(of['value'] - of['shipped']) / of['error']:+.1f}"
        lines.append((name, f"{of['value']:.5g}", error, f"{of['shipped']:.5g}", away))
    header = ("number", "fitted", "standard error", "shipped", "apart, in errors")
    return formats.table("simple", header, lines, ("left", *["right"] * 4))


def _csv(rows: Sequence[Row]) -> str:
    header = ("observer", "channel", "rmse", "ci_low", "ci_high", "lag_ms", "largest", "lost", "runs")
    return formats.as_csv(header, [[getattr(row, name) for name in header] for row in rows])


def _errors(rig: Rig, rows: Sequence[Row]) -> str:
    """Both velocities' errors on twins, an observer a line."""
    lines = [
        (first.observer, *(f"{of.rmse:.4f} [{of.ci_low:.4f}, {of.ci_high:.4f}]" for of in (first, second)))
        for first, second in zip(rows[::2], rows[1::2], strict=True)
    ]
    units = [f"{name}, {unit}" for name, unit in zip(rig.channels, rig.units, strict=True)]
    return formats.table("simple", ("RMS errors on twins", *units), lines)
