"""The sentences of an evaluation follow from its numbers."""

import math
from dataclasses import replace

import pytest

from smo_gym.evaluation import statistics, study, verdicts
from smo_gym.evaluation.report import answer
from smo_gym.evaluation.report.answer import Average, Block, Cells, Pair

NONE = Pair(math.nan, math.nan)


def block(controller="lqr", h=60.0, theta=30.0, efforts=(40.0, 400.0), near=20, ceiling=math.nan, failed=0):
    cells = Cells(near, 24, ceiling)
    arms = tuple(Average(arm, (NONE, NONE), cells, 1.0, failed, 10) for arm in ("without", "with"))
    cost = verdicts.Cost(efforts, (6.0, 29.0), (0.08, 0.38), 9, 10)
    return Block("4", controller, arms, (Pair(62.9, h), Pair(31.9, theta)), cells, cost)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ([{}], "Compensation lowers the average MSE of h by 60.0 % and of theta by 30.0 %, for 10 times the effort; "),
        ([{}, {"h": 40.0}], "lowers the average MSE of h by 40.0 to 60.0 % and of theta by 30.0 %, "),
        ([{"h": -5.0, "theta": -7.0}], "raises the average MSE of h by 5.0 % and of theta by 7.0 %, "),
        ([{"theta": -7.0}], "lowers the average MSE of h by 60.0 % and raises that of theta by 7.0 %, "),
        ([{}, {"h": -5.0}], "changes the average MSE of h by -60.0 to +5.0 % and lowers that of theta by 30.0 %, "),
        ([{"efforts": (40.0, 20.0)}, {}], "for 0.5 to 10 times the effort"),
        ([{}, {}], "the estimate of h' is worse with it in 18 of 20 runs."),
    ],
)
def test_what_the_compensation_does_is_said_as_it_is(changes, said):
    assert said in answer.words([block(**change) for change in changes])[0]


def test_a_table_with_fewer_than_half_of_its_cells_is_not_reproduced():
    def said(*near, **more):
        return answer.words([block(near=n, **more) for n in near])[1]

    assert said(20, 12) == "Within 10 % of the published are 32 of 48 MSE cells."
    assert said(20, 11).endswith("31 of 48 MSE cells. Not reproduced, with fewer than half: Table 4, LQR (11 of 24).")
    assert "MSE cells, where ten runs with every setting exact would bring 44.0." in said(20, 12, ceiling=22.0)


def test_failures_are_said_and_a_table_without_runs_is_no_success():
    assert answer.words([block(failed=1)])[2].startswith("2 of 20 runs failed and are in no average: Table 4, LQR: ")
    assert len(answer.words([block()])) == 2
    nothing = replace(block(near=0, failed=10), reductions=(NONE, NONE), cost=None)
    said = answer.words([nothing])
    assert said[0].startswith("Within 10 % of the published are 0 of 24 MSE cells. Not reproduced")


def test_without_published_cells_and_second_arm_little_is_said():
    bare = replace(block(), reductions=(), cost=None, cells=Cells(0, 0, 0.0))
    assert answer.words([bare]) == ["Nothing is published for these runs to compare with."]


def test_blocks_have_the_averages_of_the_results(small):
    outcomes = study.measure(study.groups([small], ["lqr"], ["without", "with", "oracle"], 2), seed=0)
    results = statistics.results(outcomes)
    (found,) = answer.blocks(outcomes, results)
    assert [arm.arm for arm in found.arms] == ["without", "with", "oracle"]
    averages = [r for r in results if r.cell.is_average and r.cell.metric == "mse" and r.cell.compensation == "with"]
    assert [pair.measured for pair in found.arms[1].mse] == [r.measured for r in averages]
    assert found.cells.count == 2 * 2 * 2
    assert found.cells.near == sum(arm.cells.near for arm in found.arms)
    assert math.isnan(found.arms[2].mse[0].published)
    assert found.effort_ratio == pytest.approx(found.arms[1].effort / found.arms[0].effort)


def test_a_ceiling_is_over_the_cells_that_have_one(small):
    outcomes = study.measure(study.groups([small], ["lqr"], ["with"], 11), seed=0)
    results = statistics.results(outcomes)
    assert 0.0 <= Cells.of(results).ceiling <= Cells.of(results).count
    none_stands = [replace(r, measured=math.nan, ceiling=math.nan) if r.cell.state == "h" else r for r in results]
    assert math.isfinite(Cells.of(none_stands).ceiling)
    assert Cells.of(none_stands).count == Cells.of(results).count
    ceilings = [block(ceiling=22.0), block(ceiling=math.nan)]
    assert "would bring 22.0." in answer.words(ceilings)[1]
