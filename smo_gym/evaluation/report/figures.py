"""The article's Figures 3-17 from our own runs: outcomes in, matplotlib figures out, no display needed.

Each shows what the article's caption says of it. What we changed: colours that the colour-blind and a print in grey
tell apart (those of Okabe and Ito nearest to the article's); the start of the estimation errors enlarged; of a force
that chatters, range, mean and 50 ms of its switching; the published bars beside ours, and bars of the nominal plant.
The article does not say at which level of uncertainty its trajectories are; ours are at the largest.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from ..arms import PRINTED
from ..formats import mathtext
from ..statistics import Result
from ..study import TRACED_RUNS, Group, Outcome
from . import panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 500
"""Instants of a trace that look continuous at the size of these figures."""
DENSE = 20_000
"""Instants of a start's trace: every control instant, also where an episode is not cut short (:func:`starts`)."""
FORMATS = ("pdf", "png")
_UNSAID: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None},
    "svg": dict.fromkeys(("Creator", "Date", "Format", "Type")),
}
"""What is told of a file unless it is not to be: the day, and addresses."""
_QUANTITIES = {
    "states": r"States $h$ and $\theta$",
    "errors": r"Estimation errors of $h$ and $\theta$",
    "inputs": "Force $F$",
    "mse": r"MSE of $h$ and $\theta$",
}
_PALETTE = 48  # colours of a picture
_LINE = 84  # letters in a line of a title
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "figure.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.linewidth": 0.4,
    "grid.color": "0.88",
    "axes.axisbelow": True,
    "legend.fontsize": 8,
    "legend.title_fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "legend.columnspacing": 1.0,
    "legend.borderaxespad": 0.1,
    "hatch.linewidth": 0.6,
    "pdf.fonttype": 42,
    "svg.hashsalt": "smo_gym",
    "savefig.dpi": 200,
}


@dataclass(frozen=True, slots=True)
class Plan:
    """One of the article's figures and which runs it shows."""

    number: int
    kind: Literal["states", "errors", "inputs", "mse"]
    table: str
    controllers: tuple[str, ...]
    case: str | None = None

    @property
    def name(self) -> str:
        """Name of the figure's files, without suffix."""
        case = f"-case-{self.case}" if self.case else ""
        return f"figure-{self.number:02d}-{self.kind}-{'-'.join(self.controllers)}{case}"

    def shows(self, group: Group) -> bool:
        """Whether runs of a group belong to the figure, at some level of uncertainty."""
        place = (group.scenario.table == self.table, group.name in self.controllers, group.arm in PRINTED)
        return all(place) and self.case in (None, group.case)


_BOTH, _TRACKING = ("lqr", "smc"), ("smc-tracking",)
PLANS = (
    Plan(3, "states", "4", ("lqr",)),
    Plan(4, "states", "4", ("smc",)),
    Plan(5, "mse", "4", _BOTH),
    Plan(6, "errors", "4", ("lqr",)),
    Plan(7, "errors", "4", ("smc",)),
    Plan(8, "inputs", "4", _BOTH),
    *(Plan(8 + case, "states", "5", _BOTH, str(case)) for case in range(1, 5)),
    Plan(13, "mse", "5", _BOTH),
    Plan(14, "states", "7", _TRACKING),
    Plan(15, "mse", "7", _TRACKING),
    Plan(16, "errors", "7", _TRACKING),
    Plan(17, "inputs", "7", _TRACKING),
)


def planned(groups: Iterable[Group]) -> tuple[list[Plan], list[Plan]]:
    """Which figures some groups' runs can fill, and which they cannot; before any run.

    Raises:
        ImportError: matplotlib is missing.
        ValueError: no figure can be drawn.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ImportError('figures need matplotlib: pip install "smo_gym[plots]"') from None
    groups = list(groups)
    drawn = [plan for plan in PLANS if any(plan.shows(group) for group in groups)]
    if not drawn:
        raise ValueError(
            "no runs to draw: the article's figures show the arms without and with compensation of LQR and "
            "SMC on the scenarios of its Tables 4, 5 and 7"
        )
    return drawn, [plan for plan in PLANS if plan not in drawn]


def starts(drawn: Iterable[Plan], groups: Iterable[Group]) -> list[Group]:
    """The runs whose first :data:`panels.START` some figures show at every control instant, to be measured so.

    They are the first runs of some groups, cut short; where there is a reference the episode stays, which is as long.
    """
    plans = [plan for plan in drawn if plan.kind in ("errors", "inputs")]
    shown = [group for group in groups if any(plan.shows(group) for plan in plans)]
    level = {group.scenario.table: group.uncertainty for group in sorted(shown, key=lambda group: group.uncertainty)}
    scenarios = {id(group.scenario): group.scenario for group in shown if group.scenario.reference is None}
    short = {
        key: scenario.changed(note="start", horizon=min(panels.START, scenario.horizon.value))
        for key, scenario in scenarios.items()
    }
    return [
        replace(group, scenario=short.get(id(group.scenario), group.scenario), runs=min(group.runs, TRACED_RUNS))
        for group in shown
        if group.uncertainty == level[group.scenario.table]
    ]


def draw(plan: Plan, outcomes: Iterable[Outcome], results: Iterable[Result], starts: Iterable[Outcome] = ()) -> Figure:
    """Draw one of the article's figures from our runs.

    Args:
        plan: of :data:`PLANS`.
        outcomes: of :func:`smo_gym.evaluation.study.measure`, with traces.
        results: of :func:`smo_gym.evaluation.statistics.results`, for the bars.
        starts: what :func:`starts` names, measured with :data:`DENSE` samples, for errors and inputs.

    Raises:
        ValueError: the outcomes have no traces.
    """
    from matplotlib import rc_context

    outcomes = list(outcomes)
    with rc_context(STYLE):
        if plan.kind == "mse":
            figure, text = _bars(plan, outcomes, results)
        else:
            figure, text = _trajectories(plan, outcomes, starts)
        figure.suptitle(f"Figure {plan.number}. {text}", x=0.015, ha="left")
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)  # once, not once a format
        figure.set_layout_engine("none")
    return figure


def _trajectories(plan: Plan, outcomes: Iterable[Outcome], starts: Iterable[Outcome]) -> tuple[Figure, str]:
    """A figure of all runs at the largest level of uncertainty, and what it says of them."""
    shown = [outcome for outcome in outcomes if plan.shows(outcome.group)]
    level = max(outcome.group.uncertainty for outcome in shown)
    shown = [outcome for outcome in shown if outcome.group.uncertainty == level]
    begun = [outcome for outcome in starts if plan.shows(outcome.group)]
    if plan.kind == "errors":
        figure = panels.errors(shown, begun)
    elif plan.kind == "inputs":
        figure = panels.inputs(panels.columns_by("name", shown), begun)
    else:
        figure = panels.states(panels.columns_by("arm" if plan.table == "7" else "name", shown))
    return figure, f"{_QUANTITIES[plan.kind]} of {_names(plan, shown)}\n{_said(shown)}"


def _names(plan: Plan, shown: Iterable[Outcome]) -> str:
    names = " and ".join(dict.fromkeys(panels.TITLES[outcome.group.name] for outcome in shown))
    return f"{names}, case {plan.case}" if plan.case else names


def _said(shown: Sequence[Outcome]) -> str:
    group = shown[0].group
    traced = [outcome.failed[:TRACED_RUNS] for outcome in shown]
    plants = f"{len(traced[0])} plant{'s' * (len(traced[0]) > 1)}"
    text = f"from $x(0)$ = {_state(group)}, {plants} at {100 * group.uncertainty:g} % uncertainty"
    if failed := sum(int(flags.sum()) for flags in traced):
        text += f"\n{failed} of {sum(map(len, traced))} runs failed and end there"
    return text


def _state(group: Group) -> str:
    return f"[{', '.join(f'{value:g}' for value in group.start)}]".replace("-", "−").replace(" ", "\N{NO-BREAK SPACE}")


def _bars(plan: Plan, outcomes: Iterable[Outcome], results: Iterable[Result]) -> tuple[Figure, str]:
    """A figure of the cells of a table; of the nominal plant beside levels of uncertainty, not beside cases."""
    shown = [r for r in results if r.cell.table == plan.table and r.cell.metric == "mse" and not r.cell.is_average]
    shown = [r for r in shown if r.cell.compensation in PRINTED]
    shown = [r for r in shown if not (r.cell.case and r.cell.uncertainty_percent == "0")]
    columns = {name: [r for r in shown if r.cell.controller == name] for name in plan.controllers}
    runs = [outcome for outcome in outcomes if plan.shows(outcome.group)]
    by_case = plan.table == "5"
    figure = panels.bars(
        {name: cells for name, cells in columns.items() if cells},
        "case of $x(0)$" if by_case else "uncertainty (%)",
    )
    text = f"{_QUANTITIES[plan.kind]} of {_names(plan, runs)}, {'by initial state' if by_case else 'by uncertainty'}\n"
    text += f"mean of {max(r.runs for r in shown)} runs and its 95 % interval, beside the published number"
    if by_case:
        cases = dict.fromkeys(
            f"{mathtext(outcome.group.case)}:\N{NO-BREAK SPACE}{_state(outcome.group)}" for outcome in runs
        )
        text += "\n" + textwrap.fill("$x(0)$ in case " + "; ".join(cases), _LINE)
    if failed := sum(r.failures for r in shown if r.cell.state == "h"):
        text += f"\n{failed} runs failed and are left out"
    return figure, text


def encode(figure: Figure, form: str) -> bytes:
    """A figure as the bytes of a file, of :data:`FORMATS` or svg, which has no ground; the same bytes each time."""
    from matplotlib import rc_context

    file = io.BytesIO()
    with rc_context(STYLE):
        figure.savefig(file, format=form, metadata=_UNSAID.get(form), transparent=form == "svg")
    return _small(file) if form == "png" else file.getvalue()


def _small(png: io.BytesIO) -> bytes:
    """A picture with a palette: a third of the bytes, and lines and letters look as before."""
    from PIL import Image

    file = io.BytesIO()
    with Image.open(png) as image:
        image.convert("RGB").quantize(_PALETTE, kmeans=1).save(file, "png", optimize=True, dpi=image.info["dpi"])
    return file.getvalue()
