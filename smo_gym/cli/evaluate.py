"""Measure controllers on the article's scenarios and put the numbers beside the published ones.

    smo-gym evaluate --controller all --scenario all

Prints what the tables come to and writes them to --out: results.csv, runs.csv, tables.md, tables.tex and the resolved
settings, with --figures the article's Figures 3-17 as PDF and PNG to --out/figures, and with --report a page to look at
it all.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from tqdm import tqdm

from .. import files, presets
from ..article import WITH, WITHOUT
from ..evaluation import configs, formats, scenario, study
from ..evaluation.arms import ARMS, EVERY, PRINTED, SMO, register, tuned
from ..evaluation.between import lines
from ..evaluation.report import answer, figures, page, tables
from ..evaluation.statistics import Result, results
from ..policies import named
from ..validation import choice, unknown
from . import between, computing
from .answer import show
from .arguments import Parser, fraction, one_of, positive, several, versions
from .entry import Stop, command, said, typed
from .progress import simulated

SCENARIOS = ("regulation", "initial-conditions", "tracking")
RESULTS = ("results.csv", "runs.csv", "tables.md", "tables.tex", "reference.json", "settings.yaml")
UNSAID = (*computing.OPTIONS, "verbose")
"""Options that change nothing in the results, and are not in their settings."""
COMPENSATION = {"on": (WITH,), "off": (WITHOUT,), "both": PRINTED}


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = Parser("evaluate", __doc__)
    add = parser.add_argument
    add(
        "--controller",
        **several(str),
        default=["all"],
        metavar="NAME",
        help="lqr, smc, a controller of the scenario's by name, or all of these (default); ppo for the policy that "
        "comes with the package; PATH.safetensors for a trained one; PATH.zip for a model of Stable-Baselines3 "
        "(loading one can run code); module:Class for an agent of your own",
    )
    add(
        "--scenario",
        **several(one_of("scenario", (*SCENARIOS, "all"))),
        help="regulation (Table 4), initial-conditions (Table 5), tracking (Table 7) or all (default)",
    )
    add(
        "--import",
        dest="modules",
        nargs="+",
        default=[],
        metavar="MODULE",
        help="that registers environments, or arms with observers, of your own",
    )
    add("--config", type=Path, metavar="FILE", help="a scenario file of your own in place of --scenario")
    add(
        "--uncertainty",
        **several(fraction),
        metavar="X",
        help="levels in place of the scenario's: fractions in [0, 1) such as 0.05, or percentages such as 5%%",
    )
    parser.runs(10, "random plants a cell", ", as in the article")
    parser.seed("the random plants")
    add(
        "--observer",
        default=SMO,
        metavar="NAME",
        help="smo (default), theorem (gains designed for it), oracle (the true state), one that was tuned (smo-gym "
        "observers), an arm that an imported module registers, or all",
    )
    add(
        "--compensation",
        type=one_of("compensation", tuple(COMPENSATION)),
        help="of the observer smo: on, off or both (default)",
    )
    add(
        "--force-limit",
        type=positive("newtons"),
        metavar="N",
        help="limit in newtons in place of the scenario's, for all controllers",
    )
    between.add(parser, own=True)
    add("--figures", action="store_true", help="draw the article's Figures 3-17 from these runs into DIR/figures")
    add("--report", type=Path, metavar="FILE", help="write tables, plots and runs that play into one HTML file")
    add("--verbose", action="store_true", help="print every cell of every table too, as in tables.md")
    parser.out("results", "folder for the results")
    computing.add(parser)
    return parser.parse_args(arguments)


def load(arguments: argparse.Namespace) -> list[scenario.Scenario]:
    """The chosen scenarios, with the levels and the force limit of the command line."""
    if arguments.config and arguments.scenario:
        raise ValueError(f"--scenario {' '.join(arguments.scenario)} and --config {arguments.config}: give one of them")
    names = SCENARIOS if "all" in (arguments.scenario or ["all"]) else dict.fromkeys(arguments.scenario)
    paths = [arguments.config] if arguments.config else [configs.path(name) for name in names]
    found = [scenario.load(path, arguments.controller) for path in paths]
    changes: dict[str, Any] = {}
    if arguments.uncertainty is not None:
        changes["uncertainty"] = tuple(dict.fromkeys(arguments.uncertainty))
    if arguments.force_limit is not None:
        changes["force_limit"] = arguments.force_limit
    options = between.given(arguments)
    chosen = [place.with_options("command line", **options) for place in found] if options else found
    return [place.changed(note="command line", **changes) for place in chosen]


def chosen(
    scenarios: Sequence[scenario.Scenario], wanted: Sequence[str]
) -> tuple[list[scenario.Scenario], list[str], list[str]]:
    """The scenarios with the agents that are wanted of them, the names of all controllers, and who is left out where.

    Raises:
        ValueError: no scenario has such a controller, or none takes such an agent.
        ImportError: an extra is missing.
    """
    laws = {name: settings.law for place in scenarios for name, settings in place.controllers.items()}
    found: list[str] = []
    left_out: list[str] = []
    for text in dict.fromkeys(wanted):
        known = [name for name, law in laws.items() if text in (name, law, "all")]
        if not known and not named.named(text):
            names = unknown("controller", text, {*laws, *laws.values(), named.SHIPPED, "all"})
            raise ValueError(f"{names}, PATH.safetensors, PATH.zip and module:Class")
        if not known:
            scenarios, reasons = scenario.entered(scenarios, text)
            left_out += reasons
        found += known or [text]
    return list(scenarios), list(dict.fromkeys(found)), left_out


def chosen_arms(observer: str, compensation: str | None) -> list[str]:
    """The arms of the comparison.

    Raises:
        ValueError: no arm has such an observer, or compensation is asked of one that has no such switch.
    """
    others = [name for name in ARMS if name not in PRINTED]
    if observer not in others and observer in tuned():
        register(tuned()[observer])
        others.append(observer)
    if choice("observer", observer, (SMO, *others, *tuned(), EVERY)) in others:
        if compensation is not None:
            raise ValueError(f"--compensation {compensation} is for the observer smo, not --observer {observer}")
        return [observer]
    return [*COMPENSATION[compensation or "both"], *(others if observer == EVERY else ())]


@command("evaluate")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    args = parse(arguments)
    began = time.perf_counter()
    sys.path.append(os.getcwd())  # where an agent of one's own usually is
    for module in args.modules:
        named.imported(module)
    arms = chosen_arms(args.observer, args.compensation)
    scenarios, controllers, left_out_agents = chosen(load(args), args.controller)
    groups = study.groups(scenarios, controllers, arms, args.runs)
    drawn, left_out = figures.planned(groups) if args.figures else ([], [])
    drawings = [drawing(plan, form) for plan in drawn for form in figures.FORMATS]
    if args.report:
        if args.report.resolve() in ((args.out / name).resolve() for name in (*RESULTS, *drawings)):
            raise ValueError(f"--report {args.report}: is one of the results in --out {args.out}")
        page.check(groups, args.report)
    runs = sum(group.runs for group in groups)
    with (
        files.claimed(args.out, (*RESULTS, *drawings)) as out,
        computing.computing(args, out, args.modules) as measure,
    ):
        if drawn:
            files.prepare(out / "figures")
        print("\n".join([*left_out_agents, f"{runs} runs to do"]), file=sys.stderr, flush=True)
        try:
            with simulated(groups) as bar:
                samples = figures.SAMPLES if drawn or args.report else None
                outcomes = measure(groups, args.seed, bar.update, samples)
        except ValueError as error:  # an agent's force that is not finite, or its error
            raise ValueError(f"{error}; nothing was written") from None
        numbers = results(outcomes)
        found = answer.blocks(outcomes, numbers)
        sentences, told = answer.words(found), lines(scenarios)
        written = False
        try:
            files.write_set(out, contents(args, scenarios, outcomes, numbers, sentences, told), replaced())
            written = True
        finally:  # what cannot be written can be read at least
            if args.verbose or not written:
                print(tables.render(numbers, "simple", rms=False))
                print(tables.diagnostics(outcomes, "simple"))
                print(f"\n{formats.paragraph(tables.summary(numbers), 'simple')}\n", flush=True)
            show(found, sentences, told)
        try:
            starts = measure(figures.starts(drawn, groups), args.seed, samples=figures.DENSE)
            draw(out, drawn, outcomes, starts, numbers)
            if args.report:
                line = typed("evaluate", arguments)
                files.write(args.report, page.render(outcomes, numbers, line, versions()))
        except KeyboardInterrupt:
            raise Stop(f"interrupted while drawing; the tables are in {out}") from None
        except OSError as error:
            raise Stop(f"error: {said(error)}; the tables are in {out}", 1) from None
    if left_out:
        print(f"no runs for Figure {', '.join(str(plan.number) for plan in left_out)}: not drawn")
    also = f"; all of it to look at: {args.report}" if args.report else ""
    print(f"{runs} runs in {time.perf_counter() - began:.1f} s; results are in {out}: tables.md has every cell{also}")
    return 0


def contents(
    args: argparse.Namespace,
    scenarios: Sequence[scenario.Scenario],
    outcomes: Sequence[study.Outcome],
    numbers: Sequence[Result],
    sentences: Sequence[str],
    told: Sequence[str],
) -> dict[str, str]:
    """The files of results by name, the settings they come from last; what stands between goes first."""
    left_out = (*UNSAID, *(name for name in presets.KINDS if getattr(args, name) is None))
    given = {key: value for key, value in vars(args).items() if key not in left_out}
    resolved = {
        **({"between": list(told)} if told else {}),
        "command": {key: str(value) if isinstance(value, Path) else value for key, value in given.items()},
        "versions": versions(),
        "scenarios": [place.model_dump(mode="json") for place in scenarios],
    }
    notes = tables.diagnostics(outcomes, "github")
    said_of_all = "\n\n".join(formats.markdown(text) for text in (tables.summary(numbers), *sentences))
    followed = [reference for place in scenarios if (reference := place.trajectory()) is not None]
    return {
        "results.csv": tables.results_csv(numbers),
        "runs.csv": tables.runs_csv(outcomes),
        "tables.md": "".join(f"{formats.markdown(text)}\n\n" for text in told)
        + tables.render(numbers, "github", rms=True)
        + f"\n## Diagnostics\n\n{notes}\n\n## In words\n\n{said_of_all}\n",
        "tables.tex": tables.render(numbers, "latex_booktabs", rms=True),
        **({"reference.json": followed[-1].to_json() + "\n"} if followed else {}),
        "settings.yaml": yaml.safe_dump(resolved, sort_keys=False),
    }


def draw(
    out: Path,
    drawn: Sequence[figures.Plan],
    outcomes: Sequence[study.Outcome],
    starts: Sequence[study.Outcome],
    numbers: Sequence[Result],
) -> None:
    """The figures, as a set of files."""
    made: dict[str, str | bytes] = {}
    for plan in tqdm(drawn, unit="figure", leave=False, disable=None):
        figure = figures.draw(plan, outcomes, numbers, starts)
        made |= {drawing(plan, form): figures.encode(figure, form) for form in figures.FORMATS}
    if made:
        files.write_set(out, made)


def drawing(plan: figures.Plan, form: str) -> str:
    """The name of a figure's file in --out."""
    return f"figures/{plan.name}.{form}"


def replaced() -> list[str]:
    """All that earlier runs may have left in --out, and that these results do not go with."""
    return [*RESULTS, *(drawing(plan, form) for plan in figures.PLANS for form in figures.FORMATS)]
