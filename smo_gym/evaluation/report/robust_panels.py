"""What sensors and pushes do to the arms, as one figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..arms import ARMS
from ..robustness import Push, Row
from .figures import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(rows: Sequence[Row], pushes: Sequence[Push]) -> Figure:
    """Errors and chatter behind each sensor under LQR, and the largest push that all upright plants stand."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.4), layout="constrained")
        error, chatter, push = figure.subplots(1, 3)
        sensors = list(dict.fromkeys(row.sensor for row in rows))
        for panel, name, title in (
            (error, "late_rms_theta_dot", "error of theta' after 2 s, rad/s"),
            (chatter, "total_variation", "total variation of the force, N"),
        ):
            for arm in ARMS.values():
                mine = [row for row in rows if (row.controller, row.arm) == ("lqr", arm.name)]
                values = np.array([row.means[name] for row in mine])
                if (values > 0.0).all():
                    panel.plot(range(len(mine)), values, "o-", color=arm.colour, label=arm.title, markersize=4)
            panel.set_yscale("log")
            panel.set_title(title)
            panel.set_xticks(range(len(sensors)), [sensor.replace(" ", "\n", 1) for sensor in sensors], fontsize=7)
        chatter.legend(fontsize=7)
        held = [arm for arm in ARMS.values() if any(each.arm == arm.name for each in pushes)]
        stood = {(each.case, each.arm): each.stood for each in pushes}
        cases = list(dict.fromkeys(each.case for each in pushes))
        height = 0.8 / len(cases)
        for k, case in enumerate(cases):
            newtons = np.nan_to_num([stood[case, arm.name] for arm in held])
            places = np.arange(len(held)) + (k - 0.5 * (len(cases) - 1)) * height
            bars = push.barh(places, newtons, 0.9 * height, color=[arm.colour for arm in held], alpha=1.0 - 0.4 * k)
            start = case.rpartition(" ")[2]
            said = [f"{value:.3g} from {start} rad" if value else f"none from {start} rad" for value in newtons]
            push.bar_label(bars, said, fontsize=7, padding=2)
        push.set_yticks(range(len(held)), [arm.title.replace(" ", "\n", 1) for arm in held], fontsize=7)
        push.invert_yaxis()
        push.margins(x=0.55)
        push.set_title("largest push all stand, N")
    return figure
