"""The article's Figures 3-17 from our own runs: outcomes in, matplotlib figures out, no display needed.

Each shows what the article's caption says of it. What we changed: colours that the colour-blind and a print in grey
tell apart (those of Okabe and Ito nearest to the article's); the start of the estimation errors enlarged; of a force
that chatters, range and mean; the published bars beside ours, and bars of the nominal plant. The article does not say
at which level of uncertainty its trajectories are; ours are at the largest.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..arms import PRINTED
from ..statistics import Result
from ..study import TRACED_RUNS, Group, Outcome
from . import panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 500
"""Instants of a trace that look continuous at the size of these figures."""
FORMATS = ("pdf", "png")
_STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "figure.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.linewidth": 0.4,
    "grid.color": "0.88",
    "axes.axisbelow": True,
    "legend.fontsize": 7,
    "legend.title_fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "legend.columnspacing": 1.0,
    "legend.borderaxespad": 0.1,
    "hatch.linewidth": 0.6,
    "pdf.fonttype": 42,
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


def draw(plan: Plan, outcomes: Iterable[Outcome], results: Iterable[Result]) -> Figure:
    """Draw one of the article's figures from our runs.

    Args:
        plan: of :data:`PLANS`.
        outcomes: of :func:`smo_gym.evaluation.study.measure`, with traces.
        results: of :func:`smo_gym.evaluation.statistics.results`, for the bars.

    Raises:
        ValueError: the outcomes have no traces.
    """
    from matplotlib import rc_context

    with rc_context(_STYLE):
        figure, text = _bars(plan, results) if plan.kind == "mse" else _trajectories(plan, outcomes)
        figure.suptitle(f"Figure {plan.number}. {text}", x=0.01, ha="left")
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)  # once, not once a format
        figure.set_layout_engine("none")
    return figure


def _trajectories(plan: Plan, outcomes: Iterable[Outcome]) -> tuple[Figure, str]:
    """A figure of all runs at the largest level of uncertainty, and what it says of them."""
    shown = [outcome for outcome in outcomes if plan.shows(outcome.group)]
    level = max(outcome.group.uncertainty for outcome in shown)
    shown = [outcome for outcome in shown if outcome.group.uncertainty == level]
    if plan.kind == "errors":
        figure = panels.errors(shown)
    elif plan.kind == "inputs":
        figure = panels.inputs(panels.columns_by("name", shown))
    else:
        figure = panels.states(panels.columns_by("arm" if plan.table == "7" else "name", shown))
    return figure, _said(shown)


def _said(shown: Sequence[Outcome]) -> str:
    group = shown[0].group
    names = " and ".join(dict.fromkeys(panels.TITLES[outcome.group.name] for outcome in shown))
    state = ", ".join(f"{value:g}" for value in group.scenario.initial_states.value[group.case]).replace("-", "−")
    traced = [outcome.failed[:TRACED_RUNS] for outcome in shown]
    plants = f"{len(traced[0])} plant{'s' * (len(traced[0]) > 1)}"
    text = f"{names} from $x(0)$ = [{state}], {plants} at {100 * group.uncertainty:g} % uncertainty"
    if failed := sum(int(flags.sum()) for flags in traced):
        text += f"; {failed} of {sum(map(len, traced))} runs failed and end there"
    return text


def _bars(plan: Plan, results: Iterable[Result]) -> tuple[Figure, str]:
    """A figure of the cells of a table; of the nominal plant beside levels of uncertainty, not beside cases."""
    shown = [r for r in results if r.cell.table == plan.table and r.cell.metric == "mse" and not r.cell.is_average]
    shown = [r for r in shown if r.cell.compensation in PRINTED]
    shown = [r for r in shown if not (r.cell.case and r.cell.uncertainty_percent == "0")]
    columns = {name: [r for r in shown if r.cell.controller == name] for name in plan.controllers}
    label = "initial state" if plan.table == "5" else "uncertainty (%)"
    figure = panels.bars({name: cells for name, cells in columns.items() if cells}, label)
    failed = sum(r.failures for r in shown if r.cell.state == "h")
    text = f"MSE without and with compensation: mean of {max(r.runs for r in shown)} runs and its 95 % interval"
    return figure, text + (f"; {failed} runs failed and are left out" if failed else "")


def encode(figure: Figure, form: str) -> bytes:
    """A figure as the bytes of a file in one of :data:`FORMATS`; the same figure gives the same bytes."""
    from matplotlib import rc_context

    file = io.BytesIO()
    with rc_context(_STYLE):
        figure.savefig(file, format=form, metadata={"CreationDate": None} if form == "pdf" else None)
    return file.getvalue()
