"""A metric: how long the cart was away from where it should be."""

from smo_gym.evaluation.metrics import Meter, Metric, add, register
from smo_gym.kernels.blocks import ALIVE, XD, X, at, block

SAMPLES_AWAY, SAMPLES = 0, 1


@block
def _count(signals, own, lanes):
    for i in range(lanes):
        going, e = at(signals, ALIVE, i) > 0.0, at(signals, X, i) - at(signals, XD, i)
        add(own, SAMPLES_AWAY, i, 1.0 if abs(e) > 0.5 else 0.0, going)
        add(own, SAMPLES, i, 1.0, going)


register(
    Meter(
        "excursion",
        (Metric("share_away", "%", "share of the sampling instants with |h - h_d| > 0.5 m"),),
        rows=2,
        finish=lambda rows, control_period: 100.0 * rows[[SAMPLES_AWAY]] / rows[SAMPLES],
        sample=_count,
    )
)
