"""What ``smo-gym laws`` does besides its table: what is promised, and what a smoother force costs."""

from __future__ import annotations

import argparse
from dataclasses import astuple, fields
from functools import partial

from tabulate import tabulate
from tqdm import tqdm

from .. import files
from ..evaluation import formats, law_front, law_promise
from ..evaluation.law_front import Piece
from ..evaluation.law_settings import Laws
from ..evaluation.law_table import Row
from ..evaluation.report import figures, law_panels
from ..evaluation.store import digest
from . import computing

FRONT = "front"


def promised(runs: int, seed: int) -> int:
    """Print in how many runs sigma stays at 0, where the theorem's conditions hold and where one is broken."""
    lines = []
    for name, L in law_promise.DESIGNS.items():
        found = law_promise.promise(L, runs, seed)
        margins = "; ".join(f"{each.name} by {each.margin:+.3g}" for each in found.conditions)
        inside = found.inside
        kept = int((found.kept & inside).sum())
        lines.append((name, f"{L:g}", margins, f"{kept} of {inside.sum()}", f"{found.largest[inside].max():.2g}"))
    print(
        f"Upright, true state, {1e3 * law_promise.PERIOD:g} ms, |theta(0)| <= {law_promise.LEAN:g} rad, sine and "
        f"viscous friction;\nsigma in runs with |d'| <= {law_promise.BOUND:g} m/s³ and the force within its limit\n"
    )
    header = ("design", "L, m/s³", "conditions", "kept at 0", "largest, m/s")
    print(tabulate(lines, header, "simple", disable_numparse=True))
    return 0


def front(args: argparse.Namespace, laws: Laws) -> int:
    """Tune each law under several weights of the force's variation, measure it on other plants; 0 when all is done."""
    wanted = law_front.pieces(laws, [*(args.law or laws.laws)])
    if not wanted:
        raise ValueError(f"--law {' '.join(args.law)}: nothing of it is tuned where fronts are drawn")
    drawings = [f"{FRONT}.{form}" for form in figures.FORMATS] if args.figure else []
    with files.claimed(args.out, (f"{FRONT}.csv", *drawings)) as out, computing.working(args, out) as (mapped, store):
        keys = {piece: digest(["front", laws.model_dump(mode="json"), list(piece)]) for piece in wanted}
        numbers = {piece: kept["value"] for piece in wanted if (kept := store.read(keys[piece])) is not None}
        left = [piece for piece in wanted if piece not in numbers]
        with tqdm(total=len(wanted), unit="search", desc="front", leave=False, disable=None) as bar:
            bar.update(len(numbers))
            for piece, found in mapped(partial(law_front.search, laws), left):
                store.write(keys[piece], found)
                numbers[piece] = found["value"]
                bar.update()
        rows: list[tuple[Piece, Row]] = []
        for piece in wanted:
            rows += [(piece, row) for row in law_front.points(laws, piece, numbers[piece], args.runs, args.seed)]
        columns = ["weight", *(field.name for field in fields(Row))]
        made: dict[str, str | bytes] = {
            f"{FRONT}.csv": formats.as_csv(columns, [(piece[2], *astuple(row)) for piece, row in rows])
        }
        if args.figure:
            kinds = {name: law.kind for name, law in laws.laws.items()}
            titles = {name: law.title for name, law in laws.laws.items()}
            figure = law_panels.draw_front([row for _, row in rows], titles, kinds)
            made |= {f"{FRONT}.{form}": figures.encode(figure, form) for form in figures.FORMATS}
        files.write_set(out, made)
    lines = [
        (
            laws[piece[0]].title,
            f"{piece[2]:g}",
            f"{row.case}{', outside' if row.outside == 'yes' else ''}",
            f"{row.mse_h:.3g}",
            f"{row.mse_theta:.3g}",
            f"{row.effort:,.0f}",
            f"{row.total_variation:,.0f}",
            f"{row.failures} of {row.runs}",
        )
        for piece, row in rows
    ]
    print(
        tabulate(lines, ("law", "weight", "case", "MSE h", "theta", "effort", "TV, N", "failed"), disable_numparse=True)
    )
    print(f"\nresults are in {args.out}")
    return 0
