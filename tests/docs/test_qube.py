"""The page of the rotary pendulum: its figures are those of the recordings, where they lie beside this checkout."""

import re

import pytest
from conftest import ROOT

from smo_gym.evaluation import candidates, on_recordings
from smo_gym.recordings import QUBE, load, smoothing

DATA = ROOT.parent / "shared" / "data"
PAGE = (ROOT / "docs/qube.md").read_text(encoding="utf-8")
TABLE = {
    cells[0]: cells[1:]
    for line in re.findall(r"^\| (.+) \|$", PAGE.replace("&nbsp;", " "), re.MULTILINE)
    if len(cells := line.split(" | ")) == 6
}
CHECKED = ("backward-difference", "ekf", "smo")
TITLES = {name: each.title for name, each in candidates.named(QUBE.name).observers.items()} | {
    "smo": "the article's, tuned"
}


def test_it_has_all_observers():
    assert [*TABLE][1:] == [*TITLES.values()]


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="no recordings beside this checkout")
def test_its_figures_are_measured():
    runs = on_recordings.Runs.of(QUBE, load(QUBE, DATA))
    known = candidates.named(QUBE.name)
    found = {
        (row.observer, row.channel, row.reference): row
        for row in on_recordings.rows(runs, {name: known[name] for name in CHECKED})
    }
    for name in CHECKED:
        each = [found[name, channel, smoothing.MODEL] for channel in QUBE.channels]
        cells = [f"{row.rmse:.3f} [{row.ci_low:.3f}, {row.ci_high:.3f}]" for row in each]
        for reference in (smoothing.POLYNOMIAL, smoothing.JERK):
            cells.append(" / ".join(f"{found[name, channel, reference].rmse:.3f}" for channel in QUBE.channels))
        cells.append(" / ".join(f"{row.lag_ms:.1f}" for row in each))
        assert each[1].lost == 0
        assert TABLE[TITLES[name]] == cells
