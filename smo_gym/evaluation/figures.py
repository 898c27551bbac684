"""The article's Figures 3-17 from our own runs: outcomes in, matplotlib figures out, no display needed.

Each shows what the article's caption says of it. What we changed: colours that the colour-blind and a grey print tell
apart (those of Okabe and Ito nearest to the article's), the start of the estimation errors enlarged, the published bars
beside ours, and a row of bars for the nominal plant. The article does not say at which level of uncertainty its
trajectories are; ours are at the largest.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from .rollout import Traces
from .statistics import Result
from .study import Group, Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

ARMS = {"without": "without compensation", "with": "with compensation"}
COLOURS = {
    "lqr": {"without": "#56B4E9", "with": "#000000"},  # cyan, black
    "smc": {"without": "#D55E00", "with": "#000000"},  # red, black
    "smc-tracking": {"without": "#CC79A7", "with": "#005F45"},  # purple, green (darker, for a print in grey)
}
"""Of each published controller's arms, by the article's captions."""
TITLES = {"lqr": "LQR", "smc": "SMC", "smc-tracking": "SMC tracking"}
SAMPLES = 500
"""Instants of a trace that look continuous at the size of these figures."""
WINDOW = 0.25
"""s; chattering is averaged over it."""
FORMATS = ("pdf", "png")
_POSITIONS = (("h", "m"), ("\\theta", "rad"))
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
_WIDTH = 6.9  # in, a page's text
_START = 3.0  # s, of the estimation errors
_BAR_KINDS = ("published", "measured")


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
        """Of its files."""
        case = f"-case-{self.case}" if self.case else ""
        return f"figure-{self.number:02d}-{self.kind}-{'-'.join(self.controllers)}{case}"

    def shows(self, group: Group) -> bool:
        """Whether runs of a group belong to it, at some level of uncertainty."""
        place = (group.scenario.table == self.table, group.name in self.controllers, group.arm in ARMS)
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
    """One figure.

    Args:
        plan: of :data:`PLANS`.
        outcomes: of :func:`smo_gym.evaluation.study.measure`, with traces.
        results: of :func:`smo_gym.evaluation.statistics.results`, for the bars.
    """
    from matplotlib import rc_context

    with rc_context(_STYLE):
        if plan.kind == "mse":
            cells = [r for r in results if r.cell.table == plan.table and r.cell.controller in plan.controllers]
            return _mse(plan, cells)
        shown = [outcome for outcome in outcomes if plan.shows(outcome.group)]
        level = max(outcome.group.uncertainty for outcome in shown)
        shown = [outcome for outcome in shown if outcome.group.uncertainty == level]
        return {"states": _states, "errors": _errors, "inputs": _inputs}[plan.kind](plan, shown)


def encode(figure: Figure, form: str) -> bytes:
    """A figure as the bytes of a file in one of :data:`FORMATS`; the same figure gives the same bytes."""
    from matplotlib import rc_context

    file = io.BytesIO()
    with rc_context(_STYLE):
        figure.savefig(file, format=form, metadata={"CreationDate": None} if form == "pdf" else None)
    return file.getvalue()


def _states(plan: Plan, outcomes: Sequence[Outcome]) -> Figure:
    """Positions h and theta; a column a controller, of tracking (Figure 14) a column an arm."""
    columns = _columns(outcomes, by="arm" if plan.table == "7" else "name")
    figure, axes = _panels(2, len(columns), 3.6, sharex=True, sharey="row")
    for column, chosen in zip(axes.T, columns.values(), strict=True):
        for j, panel in enumerate(column):
            for outcome in chosen:
                traces = traced(outcome)
                _lines(panel, outcome, traces.x[:, j], label=plan.table != "7")
            if traces.x_d is not None:
                panel.plot(traces.time, traces.x_d[:, j], color="black", linewidth=1.2, label="reference")
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"${state}$ ({unit})")
    return _finish(plan, figure, axes, columns)


def _errors(plan: Plan, outcomes: Sequence[Outcome]) -> Figure:
    """Errors h - hhat above theta - thetahat, over the entire simulation and, beside it, at its start."""
    horizon = outcomes[0].group.scenario.horizon.value
    columns = {"entire simulation": horizon, "its start": min(_START, horizon)}
    figure, axes = _panels(2, 2, 3.6, width_ratios=(3, 2), sharex="col", sharey="row")
    for column, until in zip(axes.T, columns.values(), strict=True):
        for j, panel in enumerate(column):
            for outcome in outcomes:
                traces = traced(outcome)
                _lines(panel, outcome, traces.x[:, j] - traces.xhat[:, j], until, label=until == horizon)
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"${state} - \\hat{{{state}}}$ ({unit})")
    return _finish(plan, figure, axes, dict.fromkeys(columns, outcomes))


def _inputs(plan: Plan, outcomes: Sequence[Outcome]) -> Figure:
    """The force without above with compensation, a column a controller: each run's mean, and the range of all."""
    columns = _columns(outcomes, by="name")
    arms = [arm for arm in ARMS if any(outcome.group.arm == arm for outcome in outcomes)]
    figure, axes = _panels(len(arms), len(columns), 1.8 * len(arms), sharex=True, sharey="col")
    for column, chosen in zip(axes.T, columns.values(), strict=True):
        for outcome in chosen:
            traces, panel = traced(outcome), column[arms.index(outcome.group.arm)]
            low, high = (_alive(outcome, values) for values in (traces.u_low, traces.u_high))
            some = np.isfinite(low).any(axis=1)
            span = (np.nanmin(low[some], axis=1), np.nanmax(high[some], axis=1))
            panel.fill_between(traces.time[some], *span, step="pre", color=_colour(outcome), alpha=0.2, linewidth=0.0)
            _lines(panel, outcome, smooth(traces.time, traces.u_mean), label=False)
    for panel, arm in zip(axes[:, 0], arms, strict=True):
        panel.set_ylabel(f"$F$ (N)\n{ARMS[arm]}")
    for column in axes.T:
        column[0].plot([], [], color="0.3", linewidth=0.8, label=f"mean over {WINDOW:g} s")
        column[0].fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="range")
    return _finish(plan, figure, axes, columns)


def _mse(plan: Plan, results: Sequence[Result]) -> Figure:
    """MSE of h above that of theta, a column a controller: the published bars beside ours and their intervals."""
    shown = [r for r in results if r.cell.metric == "mse" and not r.cell.is_average and r.cell.compensation in ARMS]
    shown = [r for r in shown if not (r.cell.case and r.cell.uncertainty_percent == "0")]
    names = [name for name in plan.controllers if any(r.cell.controller == name for r in shown)]
    figure, axes = _panels(2, len(names), 4.2, sharex="col", sharey="row")
    for column, name in zip(axes.T, names, strict=True):
        for panel, state in zip(column, ("h", "theta"), strict=True):
            _bars(panel, name, [r for r in shown if (r.cell.controller, r.cell.state) == (name, state)])
        _legend(column[0], TITLES[name])
        column[1].set_xlabel("initial state" if plan.table == "5" else "uncertainty (%)")
    for panel, (state, unit) in zip(axes[:, 0], _POSITIONS, strict=True):
        panel.set_ylabel(f"MSE of ${state}$ ({unit}$^2$)")
    runs = max(r.runs for r in shown)
    failed = sum(r.failures for r in shown if r.cell.state == "h")
    text = f"MSE in closed loop: mean of {runs} runs and its 95 % interval" + (f"; {failed} runs failed" * bool(failed))
    return _titled(figure, plan, text)


def _bars(panel: Axes, name: str, cells: Sequence[Result]) -> None:
    """Beside each other: without published, without measured, with published, with measured."""
    places = [
        ", ".join(filter(None, (r.cell.case and f"case {r.cell.case}", r.cell.uncertainty_percent))) for r in cells
    ]
    ticks = list(dict.fromkeys(places))
    bars = [(arm, kind) for arm in ARMS if any(r.cell.compensation == arm for r in cells) for kind in _BAR_KINDS]
    width = 0.84 / len(bars)
    for k, (arm, kind) in enumerate(bars):
        chosen = [(ticks.index(place), r) for place, r in zip(places, cells, strict=True) if r.cell.compensation == arm]
        colour = COLOURS[name][arm]
        middle = [tick + (k - (len(bars) - 1) / 2) * width for tick, _ in chosen]
        height = np.array([getattr(r, kind) for _, r in chosen])
        look: dict[str, Any] = {"edgecolor": colour, "linewidth": 0.6, "label": f"{arm}, {kind}"}
        if kind == "published":
            panel.bar(middle, height, width, facecolor="white", hatch="///////", **look)
        else:
            span = np.array([(r.measured - r.ci_low, r.ci_high - r.measured) for _, r in chosen]).T
            grey = {"linewidth": 0.9, "ecolor": "0.5"}
            panel.bar(middle, height, width, facecolor=colour, yerr=span, error_kw=grey, **look)
    panel.set_xticks(range(len(ticks)), ticks)
    panel.grid(visible=False, axis="x")


def _columns(outcomes: Sequence[Outcome], by: Literal["name", "arm"]) -> dict[str, list[Outcome]]:
    """The outcomes of each column by its title, in the article's order."""
    titles = TITLES if by == "name" else ARMS
    found = {title: [o for o in outcomes if getattr(o.group, by) == key] for key, title in titles.items()}
    return {title: chosen for title, chosen in found.items() if chosen}


def smooth(time: Array, force: Array) -> Array:
    """Forces (m, runs) averaged over :data:`WINDOW`."""
    if len(time) < 2:
        return force
    window = max(round(WINDOW / (time[1] - time[0])), 1)
    return np.asarray(uniform_filter1d(force, window, axis=0, mode="nearest"))


def traced(outcome: Outcome) -> Traces:
    """An outcome's traces.

    Raises:
        ValueError: it has none.
    """
    if outcome.traces is None:
        raise ValueError(f"{outcome.group.name} has no traces: measure it with samples={SAMPLES}")
    return outcome.traces


def _alive(outcome: Outcome, values: Array) -> Array:
    """Values (m, runs) without those after a run's failure."""
    traces = traced(outcome)
    duration = outcome.metrics["duration"][: values.shape[1]]
    return np.where(traces.time[:, None] <= duration + 1e-9, values, np.nan)


def _lines(panel: Axes, outcome: Outcome, values: Array, until: float = math.inf, label: bool = True) -> None:
    """One line a run of values (m, runs)."""
    time = traced(outcome).time
    shown = time <= until
    lines = panel.plot(time[shown], _alive(outcome, values)[shown], color=_colour(outcome), linewidth=0.8, alpha=0.85)
    if label:
        lines[0].set_label(ARMS[outcome.group.arm])


def _colour(outcome: Outcome) -> str:
    return COLOURS[outcome.group.name][outcome.group.arm]


def _panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure of a page's width and its panels (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _finish(plan: Plan, figure: Figure, axes: NDArray[Any], columns: Mapping[str, Sequence[Outcome]]) -> Figure:
    """What all figures of trajectories share: titles, axis of time, legends."""
    for column, title in zip(axes.T, columns, strict=True):
        _legend(column[0], title if len(columns) > 1 else "")
        column[-1].set_xlabel("$t$ (s)")
    for panel in axes.flat:
        panel.margins(x=0.0)
        panel.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    outcomes = list({id(outcome): outcome for chosen in columns.values() for outcome in chosen}.values())
    group, runs = outcomes[0].group, traced(outcomes[0]).u.shape[1]
    names = " and ".join(dict.fromkeys(TITLES[outcome.group.name] for outcome in outcomes))
    state = ", ".join(f"{value:g}" for value in group.scenario.initial_states.value[group.case]).replace("-", "−")
    text = f"{names} from $x(0)$ = [{state}], {runs} plants at {100 * group.uncertainty:g} % uncertainty"
    if failed := sum(int(outcome.failed[:runs].sum()) for outcome in outcomes):
        text += f"; {failed} of {runs * len(outcomes)} runs failed and end there"
    return _titled(figure, plan, text)


def _legend(panel: Axes, title: str) -> None:
    """Above the panel, where no line runs through it; a title alone where nothing has a name."""
    if panel.get_legend_handles_labels()[1]:
        panel.legend(title=title, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    else:
        panel.set_title(title)


def _titled(figure: Figure, plan: Plan, text: str) -> Figure:
    figure.suptitle(f"Figure {plan.number}. {text}", x=0.01, ha="left")
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.execute(figure)  # once, not once a format
    figure.set_layout_engine("none")
    return figure
