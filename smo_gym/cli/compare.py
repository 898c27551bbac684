"""The RL table: learned policies and laws, each on what it is allowed to know, on the same plants.

    smo-gym compare runs

DIR holds what smo-gym train writes, several seeds a kind. All start from Table 4's initial state under one force
limit; the score of a run is MSE of h plus MSE of theta, and a run that failed has the worst. Writes learning.md,
learning.csv and runs.csv to --out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tqdm import tqdm

from .. import files
from ..evaluation import configs, formats, scenario
from ..learning import contest
from . import computing, narrow
from .arguments import Parser, positive
from .entry import command
from .progress import simulated

RESULTS = ("learning.csv", "runs.csv", "learning.md")


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = Parser("compare", __doc__)
    add = parser.add_argument
    add(
        "folders",
        type=Path,
        nargs="*",
        default=[Path("runs")],
        metavar="DIR",
        help="of trained policies (default: runs)",
    )
    parser.runs(50, "random plants a level")
    parser.seed("the random plants")
    add(
        "--force-limit",
        type=positive("newtons"),
        default=30.0,
        metavar="N",
        help="in newtons, for all (default 30, as in training)",
    )
    add(
        "--config",
        type=Path,
        default=configs.path("regulation"),
        metavar="FILE",
        help="scenario (default: configs/regulation.yaml, Table 4)",
    )
    parser.out("results/learning")
    computing.add(parser)
    return parser.parse_args(arguments)


@command("compare")
def main(arguments: Sequence[str] | None = None) -> int:
    """Compare; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    args = parse(arguments)
    from ..learning import bootstrap, contest_table

    place = scenario.load(args.config).changed(force_limit=args.force_limit, note="command line")
    contenders, left_out = contest.trained(args.folders, place.environment)
    contenders += contest.designed(place) + contest.rivals()
    place = contest.entered(place, contenders)
    groups = [group for contender in contenders for group in contest.groups(place, contender, args.runs)]
    with files.claimed(args.out, RESULTS) as out, computing.computing(args, out) as measure:
        for line in left_out:
            print(line, file=sys.stderr)
        with simulated(groups) as bar:
            scores = contest.measure(place, contenders, args.runs, args.seed, bar.update, measure)
        rows: list[contest_table.Row] = []
        answers: dict[str, list[str]] = {}
        asked = contest_table.questions(scores)
        count = len(scores) + sum(len(pairs) for _, pairs in asked)
        with tqdm(total=count, unit="interval", leave=False, disable=None) as bar:
            for score in scores:
                rows.append(contest_table.Row(score, bootstrap.interquartile_means(score)))
                bar.update()
            for question, pairs in asked:
                answers[question] = [] if pairs else ["open: there are no such runs"]
                for a, b in pairs:
                    answers[question].append(contest_table.sentence(bootstrap.compare(a, b)))
                    bar.update()
        levels = place.uncertainty.value
        told = (
            "Interquartile means of MSE of h (m^2) + MSE of theta (rad^2) with 95 % bootstrap intervals over training "
            f"seeds and plants: {args.runs} plants a level, the same for all, forces within {args.force_limit:g} N. "
            "Over all levels: the mean of the levels' interquartile means, whose ratio the answers below are about. "
            f"LQR and SMC act every {place.control_period.value:g} s, policies as in their training, tuned laws like "
            "these, on whose box, plants and reward they were tuned. A failed run counts as the worst.\n"
        )
        texts = (
            contest_table.aggregate_csv(rows, levels),
            contest_table.runs_csv(rows, levels),
            f"{told}\n{contest_table.render(rows, levels, 'github')}\n{words(answers, 'github')}\n",
        )
        try:
            files.write_set(out, dict(zip(RESULTS, texts, strict=True)))
        finally:  # what cannot be written can be read at least
            print(narrow.paragraph(told))
            for header, lines in contest_table.tables(rows, levels):
                print(f"\n{narrow.table(header, lines)}")
            print("\n".join(map(narrow.paragraph, words(answers, "simple").splitlines())))
    print(f"\n{', '.join(RESULTS)} are in {out}")
    return 0


def words(answers: Mapping[str, Sequence[str]], form: str) -> str:
    """Each question with its answers below."""
    return "\n".join(
        "\n".join([f"\n{question}\n", *(f"- {formats.escaped(answer, form)}" for answer in answers[question])])
        for question in answers
    )
