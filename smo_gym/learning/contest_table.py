"""The RL table: controllers x kinds of observation, in full, and the answer in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..evaluation import formats
from ..evaluation.formats import as_csv
from ..evaluation.report.tables import exact
from ..wrappers.view import KINDS
from .bootstrap import Comparison, Estimate
from .contest import Scores
from .rivals import TITLES


@dataclass(frozen=True, slots=True)
class Row:
    """A contender's interquartile means."""

    scores: Scores
    means: Sequence[Estimate]
    """Interquartile means at each level, and last over all."""


def render(rows: Sequence[Row], levels: Sequence[float], form: str) -> str:
    """Both tables in a format of tabulate."""
    return "\n\n".join(formats.table(form, top, lines) for top, lines in tables(rows, levels))


def tables(rows: Sequence[Row], levels: Sequence[float]) -> list[tuple[list[str], list[list[str]]]]:
    """Header and lines of both tables: over all levels as a matrix, and level by level with what failed.

    Args:
        rows: the contenders.
        levels: of uncertainty, as fractions.
    """
    kinds = [kind for kind in KINDS if any(row.scores.contender.observation == kind for row in rows)]
    cells = {(row.scores.contender.controller, row.scores.contender.observation): _span(row.means[-1]) for row in rows}
    controllers = dict.fromkeys(controller for controller, _ in cells)
    matrix = [[controller, *(cells.get((controller, kind), "") for kind in kinds)] for controller in controllers]
    header = [
        "controller",
        "observation",
        "seeds",
        "steps",
        *(f"{100 * level:g} %" for level in levels),
        "all",
        "failed",
    ]
    detail = [
        [
            row.scores.contender.controller,
            row.scores.contender.observation,
            str(len(row.scores.contender.cards) or ""),
            _steps(row),
            *map(_span, row.means),
            f"{row.scores.failed.sum()} of {row.scores.failed.size}",
        ]
        for row in rows
    ]
    return [(["all levels", *kinds], matrix), (header, detail)]


def _steps(row: Row) -> str:
    """What each policy learned from, control periods."""
    steps = [card.configuration.get("steps") for card in row.scores.contender.cards]
    return f"{steps[0]:,}" if steps and isinstance(steps[0], int) else ""


def _span(estimate: Estimate) -> str:
    return f"{estimate.value:.4g}" + ("" if math.isnan(estimate.low) else f" [{estimate.low:.4g}, {estimate.high:.4g}]")


def questions(all_scores: Sequence[Scores]) -> list[tuple[str, list[tuple[Scores, Scores]]]]:
    """What is asked of the contenders that there are, and who answers it against whom."""
    learned = [scores for scores in all_scores if scores.contender.cards]
    known = {scores.contender.title: scores for scores in all_scores}
    on_estimates = [scores for scores in learned if scores.contender.observation == "smo"]
    on_positions = [scores for scores in learned if scores.contender.observation in ("positions", "stacked")]
    laws = [known[title] for title in ("LQR on smo", "SMC on smo") if title in known]
    tuned = [scores for scores in all_scores if scores.contender.controller in TITLES.values()]
    return [
        (
            "Does a policy that learns on SMO estimates beat one that learns on positions?",
            [(a, b) for a in on_estimates for b in on_positions],
        ),
        (
            "Does either beat LQR and SMC on SMO estimates?",
            [(a, b) for a in on_estimates + on_positions for b in laws],
        ),
        (
            "Does a policy beat a law that was tuned for the same reward, on the same observation?",
            [(a, b) for a in learned for b in tuned if a.contender.observation == b.contender.observation],
        ),
    ]


def sentence(comparison: Comparison) -> str:
    """A comparison in words."""
    a, b, ratio, probability = comparison.a, comparison.b, comparison.ratio, comparison.probability
    of_a, of_b = (f"{scores.failed.sum()} of {scores.failed.size}" for scores in (a, b))

    def span(low: float, high: float) -> str:
        return "" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]"

    return (
        f"{a.contender.title} against {b.contender.title}: {comparison.verdict}. Its interquartile mean is "
        f"{ratio.value:.3g}{span(ratio.low, ratio.high)} times the other's, and it has the lower score on the same "
        f"plant with probability {probability.value:.3g}{span(probability.low, probability.high)} "
        f"(failed: {of_a} against {of_b})."
    )


def aggregate_csv(rows: Sequence[Row], levels: Sequence[float]) -> str:
    """Interquartile means as CSV: one line a contender and level, and one over all levels, where no level stands."""
    where = ["controller", "observation", "seeds", "uncertainty"]
    header = [*where, "iqm", "ci_low", "ci_high", "runs", "failures", "row"]

    def lines() -> Iterable[list[object]]:
        for row in rows:
            contender, failed = row.scores.contender, row.scores.failed
            counts = [*(failed[:, k] for k in range(len(levels))), failed]
            of_levels = [(str(level), "level") for level in levels]
            for (level, kind), mean, runs in zip([*of_levels, ("", "all")], row.means, counts, strict=True):
                place = [contender.controller, contender.observation, len(contender.cards), level]
                yield [*place, *map(exact, (mean.value, mean.low, mean.high)), runs.size, int(runs.sum()), kind]

    return as_csv(header, lines())


def runs_csv(rows: Sequence[Row], levels: Sequence[float]) -> str:
    """Scores as CSV, one line a run."""
    header = ["controller", "observation", "seed", "uncertainty", "run", "failed", "score"]

    def lines() -> Iterable[list[object]]:
        for row in rows:
            contender = row.scores.contender
            seeds: list[object] = [card.seed for card in contender.cards] or [""]
            for (i, k, run), score in np.ndenumerate(row.scores.values):
                failed = int(row.scores.failed[i, k, run])
                place = [contender.controller, contender.observation, seeds[i], levels[k], run]
                yield [*place, failed, "" if failed else exact(float(score))]

    return as_csv(header, lines())
