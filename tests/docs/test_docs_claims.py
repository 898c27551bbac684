"""The page of claims: each verdict follows from the number beside it by the rule beside it; the counts are right."""

import math
import re

import pytest
from conftest import ROOT

from smo_gym.evaluation import claims
from smo_gym.evaluation.claims import Printed, above, below
from smo_gym.evaluation.estimates import Estimate

PAGE = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
TABLE = PAGE[PAGE.index("| place | claim |") :].partition("\n\n")[0].splitlines()[2:]
ROWS = [[cell.strip().replace("\\", "") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in TABLE]


def rule(said, claim):
    if said == "finite":
        return below(math.inf)
    kind, bound, *tolerance = re.findall(r"[\w.+-]+", said)
    if kind == "around":
        return Printed(float(bound), *map(float, tolerance), fitted=claim.startswith("Table 7"))
    return {"above": above, "below": below}[kind](float(bound))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[1][:60])
def test_a_verdict_follows_from_its_number(row):
    _, claim, said, shown, verdict, command = row
    number, *interval = map(float, re.findall(r"-?\d[\d.]*(?:e[+-]?\d+)?", shown))
    assert rule(said, claim).verdict(Estimate(number, *interval)) == verdict
    assert command.startswith("`smo-gym ")


def test_the_page_has_every_place_and_counts_right():
    places = {row[0].partition(",")[0] for row in ROWS}
    assert {place.split()[0] for place in places} == {*claims.ORDER}
    assert {f"Remark {i}" for i in range(1, 9)} | {"Theorem 1", "Theorem 2"} < places
    verdicts = [row[4] for row in ROWS]
    hold, fail, undecided = (verdicts.count(each) for each in (claims.HOLDS, claims.FAILS, claims.UNDECIDED))
    assert f"Of {len(ROWS)} statements: {hold} hold, {fail} fail, {undecided} undecided." in PAGE
