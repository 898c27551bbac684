"""Theorem 1 of the article as numbers: gain conditions, gains that satisfy them, promised times against measured ones.

    smo-gym theorem

Prints (28), (30) and (31) for the printed and for designed gains over a declared operating set and along the runs of
Table 5, then runs both observers on the same random plants, then shows where (51) and (52) fail. Put `gains` into a
settings file (--config) to see those of your own beside them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from tqdm import tqdm

from .. import (
    LQR,
    CartPendulum,
    Gains,
    SlidingModeController,
    SlidingModeObserver,
    files,
    theorem,
)
from ..evaluation import configs, scenario, store, theorem_sweep
from ..evaluation.scenario import Scenario, TheoremSettings
from ..evaluation.theorem_on_runs import SHARES, Convergence
from ..evaluation.theorem_pieces import converge_in_pieces, drawn
from ..evaluation.traces import Traces
from ..evaluation.tracing import traced
from . import narrow
from .arguments import Parser
from .entry import command
from .narrow import Told, pair

DT = 0.001
RESULT = "theorem.txt"
SWEPT, SWEPT_SECONDS = 200, 3.0  # most runs of the sweep; how long they are


@command("theorem")
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the three parts; 0 when all went well, 2 for a bad argument or setting."""
    parser = Parser("theorem", __doc__)
    config = configs.path("theorem")
    parser.add_argument("--config", type=Path, default=config, metavar="FILE", help="operating set")
    parser.runs(1000, "random plants, starts")
    parser.seed("the random plants and starts")
    parser.add_argument("--sweep", action="store_true", help="also how soon it converges, over margin, step and noise")
    parser.out(None, "folder for theorem.txt")
    args = parser.parse_args(arguments)
    settings = scenario.load_theorem(args.config)
    over = settings.over(CartPendulum())
    observer = settings.build(DT, over.model)
    with contextlib.nullcontext() if args.out is None else files.claimed(args.out, [RESULT]) as out:
        told = Told()
        with store.kept(out) if out else contextlib.nullcontext() as kept:
            answer = parts(told, settings, over, observer, args.runs, args.seed, kept)
            if args.sweep:
                swept(told, settings, over, min(args.runs, SWEPT), args.seed)
        try:
            if out is not None:
                files.write(out / RESULT, told.whole)
        finally:  # what cannot be written can be read at least
            print(f"{told.shown}\n{narrow.paragraph(answer)}")
        if out is not None:
            print(f"{RESULT} is in {out}")
    return 0


def parts(
    told: Told,
    settings: TheoremSettings,
    over: theorem.OperatingSet,
    observer: SlidingModeObserver,
    count: int,
    seed: int,
    kept: store.Store | None,
) -> str:
    """Tell the three parts, and the answer in a sentence."""
    article = scenario.named("initial-conditions")
    gains = {"printed, LQR": Gains.of("lqr"), "printed, SMC": Gains.of("smc"), "designed": Gains.of(observer.gains)}
    if settings.gains is not None:
        gains["your own"] = Gains.of(settings.gains.value)
    gain_conditions(told, gains, over)
    epsilon_1, epsilon_2 = theorem.initial_errors(settings.starts.value, observer.xhat0)
    told.say(
        f"\nOver the box of starts (36) and (37) hold for epsilon_1 > ({pair(epsilon_1)}) and epsilon_2 > "
        f"({pair(epsilon_2)})."
    )
    told.say(
        f"The designed observer wants a step of {1e3 * (observer.step or DT):.3g} ms with slopes {observer.slopes}.\n"
    )
    starts, plants = drawn(settings, over, count, seed)
    lqr = article.controllers["lqr"]
    printed = lqr.observer.build(compensation=True)
    observers = {
        "designed": observer,
        "designed gains, printed runs' slopes": theorem.stable(
            Gains.of(observer.gains), printed.slopes, DT, settings.force.value
        ),
        "printed gains, designed slopes": theorem.stable(
            Gains.of(printed.gains), observer.slopes, DT, settings.force.value
        ),
        "printed": printed,
    }
    law = article.agent("lqr")
    assert isinstance(law, LQR)
    with tqdm(total=count, desc="runs", leave=False, disable=None) as bar:
        found = converge_in_pieces(
            observers,
            law,
            over,
            starts,
            plants,
            force=settings.force.value,
            horizon=settings.horizon.value,
            settle=settings.settle.value,
            store=kept,
            progress=bar.update,
        )
    runs(told, found, settings)
    cases = len(article.initial_states.value)
    traces = {name: traced(article, name, cases) for name in article.controllers}
    trajectories(told, article, traces)
    switching(told, article, traces["smc"])
    return in_words(gains, over, found)


def in_words(gains: dict[str, Gains], over: theorem.OperatingSet, found: Convergence) -> str:
    """Which gains satisfy the conditions, and what that brought."""
    bounds = theorem.suprema(over)
    met = {name: sum(row.literal for row in theorem.conditions(value, bounds)) for name, value in gains.items()}
    counts = "; ".join(f"{name}, {count} of 3" for name, count in met.items())
    answer = f"Conditions (28), (30) and (31) that hold as printed: {counts}."
    if not found.tested.any():
        return answer
    better = pair(found.velocity_rms["printed"] / found.velocity_rms["designed"])
    return f"{answer} RMS errors of (h', theta') are ({better}) times smaller with the designed than the printed gains."


def gain_conditions(told: Told, gains: dict[str, Gains], over: theorem.OperatingSet) -> None:
    """Tell whether conditions (28), (30) and (31) hold for some gains over an operating set."""
    bounds = theorem.suprema(over)
    rows = [
        (name, row.name, pair(row.gain), pair(row.supremum), " ".join(map(said, row.by_row)), said(row.literal))
        for name, value in gains.items()
        for row in theorem.conditions(value, bounds)
    ]
    told.say(
        f"Over |theta| <= {over.theta} rad, |h'| <= {over.speed[0]} m/s, |theta'| <= {over.speed[1]} rad/s, "
        f"plants within {100 * over.uncertainty:g} %:\n"
    )
    header = ("gains", "condition", "gain (h, theta)", "supremum", "row by row", "as printed")
    told.table(header, rows)


def runs(told: Told, found: Convergence, settings: TheoremSettings) -> None:
    """Tell what the runs showed."""
    stayed, total = found.tested, len(found.stayed)
    n, inside = int(stayed.sum()), int(found.kept[stayed].sum())
    bounds = ", ".join(f"{value:.2f}" for value in found.largest)
    told.say(f"Largest |theta|, |h'|, |theta'|, estimates of these, and |u|: {bounds}.")
    told.say(
        f"{n} of {total} runs stayed in the operating set, with |u| <= {settings.force.value:g} N, and outlasted t0; "
        f"{total - n} did not and are not counted."
    )
    if not n:
        return
    interval = stats.binomtest(inside, n).proportion_ci(method="wilson")
    told.say(
        f"{inside} of {n} were inside the layer of both positions by the time of (43) and stayed there, which is seen "
        "and, with tanh, not promised "
        f"(95 % Wilson interval {interval.low:.4f} to {interval.high:.4f}).\n"
    )
    rows = [
        (
            state,
            f"{np.median(found.promised[i, stayed]):.3f}",
            f"{np.median(found.reached[i, stayed]):.3f}",
            f"{np.min((found.promised - found.reached)[i, stayed]):z.4f}",
            f"{np.median(found.promised_velocity[i, stayed]):.3f}",
            f"{np.nanmax(found.velocity_error[i, stayed]):.3f}",
        )
        for i, state in enumerate(("h", "theta"))
    ]
    header = (
        "",
        "t0 of (43), s",
        "reached, s",
        "least to spare, s",
        "t1 of (48), s",
        "largest velocity error after t1",
    )
    told.table(header, rows, " \n\n")
    with_tanh(told, found, settings.settle.value)
    rms = [
        (name, *(f"{v:.2g}" for v in values), pair(found.velocity_rms["printed"] / values))
        for name, values in found.velocity_rms.items()
    ]
    title = (
        f"RMS velocity error after {settings.settle.value:g} s, same runs",
        "h', m/s",
        "theta', rad/s",
        "smaller by",
    )
    told.table(title, rms, " \n\n")


def with_tanh(told: Told, found: Convergence, settle: float) -> None:
    """The bounds that hold with tanh, which (43) and (48) are not."""
    n = int(found.stayed.sum())
    for i, share in enumerate(SHARES):
        kept = found.bounded[i][:, found.stayed].all(axis=0)
        told.say(
            f"{int(kept.sum())} of {n} kept |e| <= atanh((V + kappa) / m1) / k_p from |e(0)| / kappa on, "
            f"kappa = {share:g} (m1 - V)."
        )
    told.say(
        f"In the end |X2 - X2hat| is at most ({pair(found.velocity_bound)}) m/s, rad/s; largest after {settle:g} s: "
        f"({pair(found.velocity_settled[:, found.stayed].max(axis=1))}).\n"
    )


def swept(told: Told, settings: TheoremSettings, over: theorem.OperatingSet, count: int, seed: int) -> None:
    """Tell how soon designed observers converge on the true state's own trajectories."""
    low, high = np.array(settings.starts.value)
    starts = theorem_sweep.edge(low, high, count, np.random.default_rng(seed))
    law: Any = scenario.named("initial-conditions").agent("lqr")
    given = (over, settings.slopes.value, settings.force.value, law, starts, seed, DT, SWEPT_SECONDS)
    with tqdm(total=len(theorem_sweep.DESIGNS), unit="design", leave=False, disable=None) as bar:
        rows = [row.said() for row in theorem_sweep.sweep(*given, told=bar.update)]
    told.say(f"\nRemark 2 on {count} runs from the edge of the box of starts:\n")
    told.table(theorem_sweep.HEADER, rows)


def trajectories(told: Told, article: Scenario, traces: dict[str, Traces]) -> None:
    """Tell what conditions (28), (30) and (31) want along runs of Table 5's cases."""
    rows = []
    for name, runs in traces.items():
        gains = Gains.of(article.controllers[name].observer.gains.value)
        for i, case in enumerate(article.initial_states.value):
            bounds = theorem.suprema_along(runs.x[:, :, i].T, runs.xhat[:, :, i].T, CartPendulum())
            checked = theorem.conditions(gains, bounds)
            verdicts = [f"{pair(row.supremum)} ({' '.join(map(said, row.by_row))})" for row in checked]
            rows.append((f"{name.upper()}, case {case}", *verdicts))
    names = ("(28): sup |X2| (row by row)", "(30): sup of the drift's error", "(31): sup of the gain's error")
    told.table(("Table 5, nominal plant", *names), rows, " \n\n")


def switching(told: Told, article: Scenario, traces: Traces) -> None:
    """Tell whether (51) and (52) hold along SMC runs of Table 5's cases on the nominal plant."""
    law = article.agent("smc")
    assert isinstance(law, SlidingModeController)
    rows = []
    for i, case in enumerate(article.initial_states.value):
        push, needed = theorem.controllability(law, traces.xhat[:, :, i].T)
        share = f"{100 * np.mean(push > needed):.2f} %"
        least = f"{push[1:].min() / law.Z0:.1g}"  # at the very start xhat = 0
        rows.append(
            (f"case {case}", least, f"{np.median(push):.2g}", f"{push.max():.3g}", f"{needed.min():.3g}", share)
        )
    header = (
        "SMC, Table 5",
        "(51): least |ds/dx g|",
        "(52): |ds/dx g| Z0, median",
        "largest",
        "|ds/dx f| + lambda, least",
        "holds for",
    )
    told.table(header, rows)
    told.say("\ns is a sum of squares: its gradient vanishes on s = 0, where (52) would ask 0 > lambda + delta.")


def said(holds: object) -> str:
    """A truth value in a word."""
    return "holds" if holds else "fails"
