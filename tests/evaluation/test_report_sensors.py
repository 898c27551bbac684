"""The report of runs whose sensors are not exact."""

import numpy as np
import pytest
from test_report import Page, load, page_of

from smo_gym.evaluation.report import page_traces

ENCODERS = {"sensor": {"value": "encoders", "source": "chosen"}}


@pytest.fixture(scope="module")
def report():
    """Regulation with encoders, and upright with exact sensors."""
    regulation = load("regulation", horizon=2.0, uncertainty=(0.1,), options=ENCODERS)
    upright = load("upright", horizon=1.0, uncertainty=(0.1,), initial_states={"near": (0.0, 0.1, 0.0, 0.0)})
    return page_of([regulation, upright], ["lqr"], runs=2)


def test_channels_of_sensors_are_there_where_any_sensor_is_not_exact(report):
    outcomes, _, text = report
    assert page_traces.channels(outcomes)[-2:] == page_traces.SENSED
    exact = [outcome for outcome in outcomes if outcome.traces.y is None]
    assert page_traces.channels(exact) == page_traces.CHANNELS
    assert page_traces.pack(exact, 1)[0] == [
        place | {"first": i} for i, place in enumerate(page_traces.pack(outcomes, 1)[0][len(outcomes) - len(exact) :])
    ]
    assert "sensor_h" in Page(text).scripts["data"]
    assert "Table 4: sensor: encoders, resolution=(0.0001, 0.001534)" in text


@pytest.mark.slow
def test_what_the_sensors_said_is_drawn_beside_the_truth(browser, report, tmp_path):
    outcomes, _, text = report
    path = tmp_path / "report.html"
    path.write_text(text)
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]", state="attached")
        found = axe.run(page)
        assert found.violations_count == 0, found.generate_report()
        page.select_option("#choice [name=uncertainty]", "10 %")
        drawn = page.evaluate("document.querySelector('#curves').data.map(one => [one.meta, [...one.y]])")
        errors = {meta["state"]: y for meta, y in drawn if meta["kind"] == "sensor"}
        arms = [(o.group.scenario.table, o.group.uncertainty, o.group.arm) for o in outcomes]
        traces = outcomes[arms.index(("4", 0.1, "with"))].traces
        for state, off in enumerate((traces.y - traces.x[:, :2])[..., 0].T):
            np.testing.assert_allclose(errors[state], off, atol=2e-4 * np.ptp(off))
        assert "measured" in page.inner_text("#curves-key")
        page.close()
