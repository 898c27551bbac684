"""The article's figures: what they show is what was measured and published."""

import re
import sys
from itertools import pairwise

import numpy as np
import pytest
from conftest import ROOT
from matplotlib.colors import to_rgb, to_rgba

from smo_gym.cli.evaluate import main as evaluate
from smo_gym.evaluation import scenario, statistics, study
from smo_gym.evaluation.report import figures, panels

NAMES = ("regulation", "initial-conditions", "tracking")


def load(name, **changes):
    return scenario.named(name).changed(**({"control_period": 0.01} | changes))


@pytest.fixture(scope="module")
def study_of_all():
    """All of the article's runs, coarser and shorter, and more of each than are traced."""
    scenarios = [load(name, **({} if name == "tracking" else {"horizon": 5.0})) for name in NAMES]
    outcomes = study.measure(study.groups(scenarios, ["lqr", "smc"], ["without", "with"], 12), seed=0, samples=100)
    starts = study.measure(figures.starts(figures.PLANS, (o.group for o in outcomes)), seed=0, samples=figures.DENSE)
    return outcomes, statistics.results(outcomes), starts


@pytest.fixture
def drawn(study_of_all):
    def draw(number):
        (plan,) = (plan for plan in figures.PLANS if plan.number == number)
        return plan, figures.draw(plan, *study_of_all)

    return draw


def shown(study_of_all, controller, table, arm, level=0.2, case="", start=False):
    groups = ((o, o.group) for o in study_of_all[2 if start else 0])
    wanted = (table, controller, arm, level, case)
    (outcome,) = (o for o, g in groups if (g.scenario.table, g.name, g.arm, g.uncertainty, g.case) == wanted)
    return outcome


def lines(panel, colour):
    found = [line for line in panel.lines if to_rgb(line.get_color()) == to_rgb(colour) and len(line.get_xdata()) > 2]
    return [line for line in found if line.get_label() != "reference"]


def test_traces_are_of_the_first_ten_runs_and_change_no_number(study_of_all):
    outcomes, *_ = study_of_all
    again = study.measure([outcome.group for outcome in outcomes], seed=0)
    for plain, traced in zip(again, outcomes, strict=True):
        assert plain.traces is None
        runs = min(traced.group.runs, study.TRACED_RUNS)
        assert traced.traces.x.shape == (len(traced.traces.time), 4, runs)
        assert traced.traces.time[-1] == pytest.approx(traced.group.scenario.horizon.value)
        assert 100 < len(traced.traces.time) < 200
        assert (plain.metrics["mse_h"] == traced.metrics["mse_h"]).all()
        peak = np.maximum(-traced.traces.u_low, traced.traces.u_high).max(axis=0)
        assert (peak == traced.metrics["peak_force"][:runs]).all()
        assert (traced.traces.u_low <= traced.traces.u_mean + 1e-9).all()
        assert (traced.traces.u <= traced.traces.u_high).all()
        assert (traced.traces.x_d is None) == (traced.group.scenario.reference is None)


def test_traces_of_no_instants_or_none_at_all_are_refused(study_of_all):
    groups = [outcome.group for outcome in study_of_all[0]]
    with pytest.raises(ValueError, match="samples=0 must be a positive integer"):
        study.measure(groups, seed=0, samples=0)
    nothing = [study.Outcome(o.group, o.metrics, o.failed) for o in study_of_all[0]]
    with pytest.raises(ValueError, match="lqr has no traces to draw"):
        figures.draw(figures.PLANS[0], nothing, [])


def test_every_figure_of_the_article_is_planned_once():
    assert [plan.number for plan in figures.PLANS] == list(range(3, 18))
    assert len({plan.name for plan in figures.PLANS}) == 15


@pytest.mark.parametrize(("number", "controller"), [(3, "lqr"), (4, "smc")])
def test_states_are_all_ten_runs_of_both_arms(drawn, study_of_all, number, controller):
    _, figure = drawn(number)
    assert "20 %" in figure.get_suptitle()
    for j, panel in enumerate(figure.axes):
        for arm, colour in panels.COLOURS[controller].items():
            traces = shown(study_of_all, controller, "4", arm).traces
            ours = lines(panel, colour)
            assert len(ours) == 10
            for run, line in enumerate(ours):
                np.testing.assert_array_equal(line.get_ydata(), traces.x[:, j, run])
                np.testing.assert_array_equal(line.get_xdata(), traces.time)


@pytest.mark.parametrize("number", [9, 10, 11, 12])
def test_cases_have_lqr_on_the_left_and_smc_on_the_right(drawn, study_of_all, number):
    _, figure = drawn(number)
    for i, panel in enumerate(figure.axes):
        controller = ("lqr", "smc")[i % 2]
        for arm, colour in panels.COLOURS[controller].items():
            traces = shown(study_of_all, controller, "5", arm, 0.05, str(number - 8)).traces
            assert (lines(panel, colour)[3].get_ydata() == traces.x[:, i // 2, 3]).all()


def test_tracking_has_an_arm_a_column_and_the_reference_in_black(drawn, study_of_all):
    _, figure = drawn(14)
    for i, panel in enumerate(figure.axes):
        arm = ("without", "with")[i % 2]
        traces = shown(study_of_all, "smc-tracking", "7", arm).traces
        ours = lines(panel, panels.COLOURS["smc-tracking"][arm])
        assert len(ours) == 10
        assert (ours[0].get_ydata() == traces.x[:, i // 2, 0]).all()
        (reference,) = (line for line in panel.lines if line.get_label() == "reference")
        assert to_rgb(reference.get_color()) == (0, 0, 0)
        assert reference.get_ydata()[0] == 1.0  # the reference begins at h = 1 m, theta = 1 rad
        assert abs(reference.get_ydata()[-1]) < 1e-3  # and ends at rest


@pytest.mark.parametrize(
    ("number", "controller", "table"), [(6, "lqr", "4"), (7, "smc", "4"), (16, "smc-tracking", "7")]
)
def test_errors_are_true_less_estimated(drawn, study_of_all, number, controller, table):
    _, figure = drawn(number)
    for i, panel in enumerate(figure.axes):
        j, enlarged = i // 2, i % 2
        traces = shown(study_of_all, controller, table, "without", start=bool(enlarged)).traces
        line = lines(panel, panels.COLOURS[controller]["without"])[7]
        expected = (traces.x - traces.xhat)[:, j, 7]
        np.testing.assert_array_equal(line.get_ydata(), expected[traces.time <= panels.START] if enlarged else expected)
        if enlarged:
            np.testing.assert_allclose(line.get_xdata(), 0.01 * np.arange(201))  # every control instant
        assert line.get_ydata()[0] == traces.x[0, j, 7]  # xhat(0) = 0
    assert figure.axes[0].get_ylabel() == r"$h - \hat{h}$ (m)"


def test_a_start_is_the_beginning_of_the_same_runs(study_of_all):
    *_, starts = study_of_all
    assert {start.group.name for start in starts} == {"lqr", "smc", "smc-tracking"}
    for start in starts:
        group = start.group
        whole = shown(study_of_all, group.name, group.scenario.table, group.arm).traces
        instants = np.searchsorted(start.traces.time, whole.time[whole.time <= panels.START] - 1e-9)
        for name in ("x", "xhat", "u"):
            np.testing.assert_array_equal(getattr(start.traces, name)[instants], getattr(whole, name)[: len(instants)])


def test_titles_name_the_quantity_and_no_two_are_alike(drawn):
    words = {"states": "States", "errors": "Estimation errors", "inputs": "Force", "mse": "MSE"}
    titles = []
    for plan in figures.PLANS:
        _, figure = drawn(plan.number)
        number, title = figure.get_suptitle().splitlines()[0].split(". ")
        assert number == f"Figure {plan.number}"
        assert title.startswith(words[plan.kind])
        titles.append(title)
    assert len({*titles}) == 15


def test_cases_are_explained_where_bars_stand_for_them(drawn):
    title = " ".join(drawn(13)[1].get_suptitle().split())
    assert "1: [1, 1, 0.1, 0.01]; 2: [0.15, −1, 0.1, 0.01]; 3: [−1, −1, 0.1, 0.01]; 4: [−0.2, 1, 0.1, 0.01]" in title


@pytest.mark.parametrize("number", [8, 17])
def test_switching_is_fifty_milliseconds_at_every_control_instant(number):
    scenarios = [scenario.named(name) for name in ("regulation", "tracking")]
    groups = [g for g in study.groups(scenarios, ["smc"], ["without", "with"], 1) if g.uncertainty in (0.0, 0.2)]
    groups = [g for g in groups if g.scenario.table == ("4" if number == 8 else "7")]
    (plan,) = (plan for plan in figures.PLANS if plan.number == number)
    starts = study.measure(figures.starts([plan], groups), seed=0, samples=figures.DENSE)
    figure = figures.draw(plan, starts, [], starts)
    assert len(starts) == 2
    for panel, start in zip(figure.axes[1::2], starts, strict=True):
        (line,) = (line for line in panel.lines if len(line.get_xdata()) > 2)
        time, force = line.get_data()
        np.testing.assert_allclose(time, np.arange(1950, 2001) / 1000, atol=1e-9)
        assert (force == start.traces.u[1950:2001, 0]).all()
        assert line.get_drawstyle() == "steps-pre"  # over the period that ended at the instant
        assert sum(a * b < 0.0 for a, b in pairwise(force)) >= 3


@pytest.mark.parametrize(("number", "controllers"), [(8, ("lqr", "smc")), (17, ("smc-tracking",))])
def test_inputs_show_the_range_of_all_runs(drawn, study_of_all, number, controllers):
    _, figure = drawn(number)
    columns = len(controllers) + 1  # the last one is of the switching
    for i, panel in enumerate(figure.axes):
        if i % columns == len(controllers):
            continue
        controller, arm = controllers[i % columns], ("without", "with")[i // columns]
        traces = shown(study_of_all, controller, "4" if number == 8 else "7", arm).traces
        (paths,) = (collection.get_paths() for collection in panel.collections if collection.get_paths())
        band = paths[0].vertices[:, 1]
        assert (band.min(), band.max()) == (traces.u_low.min(), traces.u_high.max())
        assert len(lines(panel, panels.COLOURS[controller][arm])) == 10
        assert arm in panel.get_ylabel() or i % columns


@pytest.mark.parametrize(("number", "rows"), [(5, 7), (13, 4), (15, 7)])
def test_bars_are_the_measured_and_published_numbers(drawn, study_of_all, number, rows):
    plan, figure = drawn(number)
    for i, panel in enumerate(figure.axes):
        controller = plan.controllers[i % len(plan.controllers)]
        state = ("h", "theta")[i // len(plan.controllers)]
        assert len(panel.get_xticks()) == rows
        bars = [bars for bars in panel.containers if hasattr(bars, "patches")]
        for bar, label in zip(bars, ("published", "measured") * 2, strict=True):
            arm = bar.get_label().split(",")[0]
            assert bar.get_label() == f"{arm}, {label}"
            assert to_rgba(panels.COLOURS[controller][arm]) == bar.patches[0].get_edgecolor()
            cells = {
                getattr(r, label)
                for r in study_of_all[1]
                if (r.cell.table, r.cell.controller, r.cell.state, r.cell.compensation, r.cell.metric)
                == (plan.table, controller, state, arm, "mse")
            }
            heights = [patch.get_height() for patch in bar.patches if np.isfinite(patch.get_height())]
            assert set(heights) <= cells
            assert len(heights) >= rows - 1  # nothing is published of the nominal plant


def test_arms_differ_in_a_grey_print():
    def grey(colour):
        return np.dot(to_rgb(colour), (0.299, 0.587, 0.114))

    for arms in panels.COLOURS.values():
        assert abs(grey(arms["without"]) - grey(arms["with"])) > 0.3


def test_files_are_vector_and_raster_and_the_same_again(drawn, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # its global state is not for a library
    _, figure = drawn(3)
    pdf, png = (figures.encode(figure, form) for form in figures.FORMATS)
    assert pdf.startswith(b"%PDF-")
    assert b"/Subtype /Image" not in pdf
    assert png.startswith(b"\x89PNG")
    assert pdf == figures.encode(drawn(3)[1], "pdf")


def test_one_arm_of_one_plant_is_drawn_too():
    tracking = load("tracking", uncertainty=(0.0,))
    outcomes = study.measure(study.groups([tracking], ["smc"], ["with"], 1), seed=0, samples=100)
    results = statistics.results(outcomes)
    starts = study.measure([outcome.group for outcome in outcomes], seed=0, samples=figures.DENSE)
    drawn, left_out = figures.planned([outcome.group for outcome in outcomes])
    assert [plan.number for plan in drawn] == [14, 15, 16, 17]
    assert len(drawn) + len(left_out) == 15
    states, bars, _, inputs = (figures.draw(plan, outcomes, results, starts) for plan in drawn)
    assert "1 plant at 0 %" in states.get_suptitle()
    assert [panel.get_legend().get_title().get_text() for panel in states.axes[:1]] == ["with compensation"]
    assert bars.axes[0].containers[-1].get_label() == "with, measured"
    assert len(inputs.axes) == 2


def test_failed_runs_end_where_they_failed():
    table5 = load("initial-conditions", horizon=3.0, track_limit=1.03)
    outcomes = study.measure(study.groups([table5], ["lqr"], ["without", "with"], 3), seed=0, samples=100)
    (plan,) = (plan for plan in figures.PLANS if plan.number == 9)
    figure = figures.draw(plan, outcomes, [])
    failed = [o for o in outcomes if plan.shows(o.group) and o.group.uncertainty and o.failed.any()]
    assert "3 of 6 runs failed and end there" in figure.get_suptitle()
    line = lines(figure.axes[0], panels.COLOURS["lqr"][failed[0].group.arm])[0]
    last = line.get_xdata()[np.isfinite(line.get_ydata())][-1]
    assert last == pytest.approx(failed[0].metrics["duration"][0], abs=0.04)


def test_the_command_draws_what_it_has_runs_for(tmp_path, capsys):
    config = tmp_path / "short.yaml"
    config.write_text("extends: regulation\nhorizon: {value: 1.0, source: chosen}\n")
    options = ["--config", str(config), "--controller", "lqr", "--runs", "2", "--out", str(tmp_path / "out")]
    assert evaluate([*options, "--figures"]) == 0
    assert "no runs for Figure 4, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17: not drawn" in capsys.readouterr().out
    names = ("03-states-lqr", "05-mse-lqr-smc", "06-errors-lqr", "08-inputs-lqr-smc")
    expected = {f"figure-{name}.{form}" for name in names for form in ("pdf", "png")}
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == expected


def test_what_cannot_be_drawn_is_said_before_any_run(tmp_path, capsys, monkeypatch):
    options = ["--figures", "--out", str(tmp_path / "out")]
    assert evaluate([*options, "--observer", "oracle"]) == 2
    assert "no runs to draw" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert evaluate(options) == 2
    assert 'pip install "smo_gym[plots]"' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_gallery_shows_every_figure_and_says_what_it_shows():
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    pictures = dict(re.findall(r"!\[([^\]]{40,})\]\(images/figures/([\w-]+)\.png\)", page))
    assert [*pictures.values()] == [plan.name for plan in figures.PLANS]  # each with a text of its own
    paths = [ROOT / "docs" / "images" / "figures" / f"{plan.name}.png" for plan in figures.PLANS]
    assert max(path.stat().st_size for path in paths) <= 65_000
    assert sum(path.stat().st_size for path in paths) < 1_000_000
    assert {*paths} == {*paths[0].parent.iterdir()}
