"""What the compensation beta_2 |u| does, settled; and each statement of the article with a number and a verdict.

    smo-gym settle            # on the gains of configs/settle.yaml
    smo-gym settle --search   # find these gains again, on training plants

Compares the observer without and with compensation, with constant gains in its place and with the true state, begun at
0 and at the measured positions, under LQR and SMC, in Tables 4, 5 and 7. Prints, and writes to --out, the comparison
(settle.md, settle.csv) and the claims (claims.csv).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import yaml
from tqdm import tqdm

from .. import files
from ..evaluation import claims, claims_of_runs, claims_of_theory, evidence, settled, settling, settling_search, store
from ..evaluation.report import settling_tables
from ..evaluation.settling import Runs
from ..evaluation.study import simulated_seconds
from ..evaluation.theorem_pieces import RUNS
from . import computing, narrow
from .arguments import Parser
from .entry import Stop, command
from .progress import simulated
from .starting import line

RESULTS = ("claims.csv", "settle.csv", "settle.md")
FOUND = "settle.yaml"


@command("settle")
def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or search; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    parser = Parser("settle", __doc__)
    parser.runs(100, "random plants a row of a table")
    parser.seed("the random plants")
    parser.add_argument("--search", action="store_true", help=f"search for the gains, and write them as {FOUND} alone")
    parser.out("settle")
    computing.add(parser)
    args = parser.parse_args(arguments)
    return _search(args) if args.search else _measure(args)


def _measure(args: argparse.Namespace) -> int:
    wanted = settling.wanted(settled.ours(), args.runs)
    every = [group for groups in wanted.values() for group in groups]
    with (
        files.claimed(args.out, RESULTS) as out,
        computing.computing(args, out) as measure,
        settling.measuring(),
    ):
        with simulated(every) as bar:
            outcomes = iter(measure(every, args.seed, bar.update))
        runs = Runs({place: [next(outcomes) for _ in groups] for place, groups in wanted.items()})
        with tqdm(total=evidence.WORK, desc="theorem", leave=False, disable=None) as bar:
            found = evidence.evidence(args.seed, store.Store(out / store.FOLDER), bar.update)
        told = [
            *claims_of_runs.claims(runs, _line("settle", args.runs, args.seed), line("consistency")),
            *claims_of_theory.claims(found, _line("settle", args.runs, args.seed), _line("theorem", RUNS, args.seed)),
        ]
        told.sort(key=claims.order)
        rows = settling_tables.rows(runs)
        made: dict[str, str | bytes] = {
            RESULTS[0]: claims.as_csv(told),
            RESULTS[1]: settling_tables.as_csv(rows),
            RESULTS[2]: f"{settling_tables.as_markdown(rows)}\n\n{claims.table(told, 'github')}\n",
        }
        try:
            files.write_set(out, made)
        finally:  # what cannot be written can be read at least
            for each in settling_tables.tables(rows, whole=False):
                print(f"{each.title}\n\n{narrow.table(each.header, each.lines)}\n")
            print(f"{_shown(told)}\n\n{narrow.paragraph(claims.counts(told))}")
    print(f"\nresults of {simulated_seconds(every):,.0f} simulated seconds are in {args.out}")
    return 0


def _line(name: str, runs: int, seed: int) -> str:
    return f"{line(name)} --runs {runs} --seed {seed}"


def _shown(told: Sequence[claims.Claim]) -> str:
    lines = [
        (each.place, each.claim, each.rule.said, f"{each.number} {each.interval}".rstrip(), each.verdict)
        for each in told
    ]
    return narrow.table(("place", "claim", "holds if", "number", "verdict"), lines)


def _search(args: argparse.Namespace) -> int:
    with files.claimed(args.out, (FOUND,)) as out, store.kept(out) as kept, settling.measuring():
        try:
            with tqdm(total=settling_search.EVALUATIONS, unit="evaluation", leave=False, disable=None) as bar:
                found = settling_search.searched(kept, bar.update)
        except KeyboardInterrupt:
            raise Stop(f"interrupted; the same command goes on from what is in {out}") from None
        text = yaml.safe_dump(found, sort_keys=False, width=120, default_flow_style=None)
        try:
            files.write_set(out, {FOUND: text})
        finally:
            print(text)
    print(f"{FOUND} is in {args.out}")
    return 0
