"""One closed loop, two drivers: a law inside of the compiled loop, and the same law asked once a control period."""

import importlib
import math

import numpy as np
import pytest
from gymnasium.vector import VectorWrapper

from smo_gym import LQR, SlidingModeController, SlidingModeObserver, VectorObserverWrapper
from smo_gym.evaluation import metrics, rollout
from smo_gym.kernels.blocks import XHAT, Y, at, block, put
from smo_gym.loop import Loop, Part, columns
from smo_gym.observers.estimator import Compiling

HANGING, UPRIGHT, TRACKING = "SMOPendulum-v0", "SMOPendulumUpright-v0", "SMOPendulumTracking-v0"
K = {
    HANGING: [7.234, -4.132, 11.075, -1.025],
    UPRIGHT: [-3.16, -62.0, -6.6, -13.0],
    TRACKING: [7.234, -4.132, 11.075, -1.025],
}
SLOTS = 67  # a whole block and a rest


class Asked:
    """A law of which only ``predict`` is to be seen."""

    def __init__(self, law):
        self.predict = law.predict


def law_of(kind, environment, control_period):
    if kind == "lqr":
        return LQR(K[environment])
    return SlidingModeController((1.0, 2.0, 2.0, 1.0), control_period, 5.0, wrap=environment != TRACKING)


def same(a, b, what):
    """Equal to the bit, NaN where NaN is."""
    assert a.dtype == b.dtype, what
    assert np.array_equal(a, b, equal_nan=a.dtype == np.float64), what


class Between(VectorWrapper):
    """A wrapper of a user's own, which might change what is measured: the observer then works outside of the loop."""


def both(make_vec, law, observer, *, environment=HANGING, n=SLOTS, trace_every=3, options=None, **task):
    """A law in and beside the compiled loop, its observer inside and outside: rollouts found equal to the bit."""
    found = []
    for agent, between in ((law, False), (Asked(law), False), (Asked(law), True)):
        env = make_vec(n, environment, autoreset_mode="Disabled", **task)
        env = VectorObserverWrapper(Between(env) if between else env, observer)
        assert env.plugged is not between
        found.append(rollout(env, agent, seed=0, options=options, trace_every=trace_every))
    inside, *others = found
    for outside in others:
        assert inside.metrics.keys() == outside.metrics.keys()
        for name, values in inside.metrics.items():
            same(values, outside.metrics[name], name)
        same(inside.failed, outside.failed, "failed")
        if trace_every is not None:
            for name in ("time", "x", "xhat", "u", "u_low", "u_high", "u_mean"):
                same(getattr(inside.traces, name), getattr(outside.traces, name), name)
    return inside


def starts(scale, n=SLOTS):
    return np.random.default_rng(1).uniform(-scale, scale, (n, 4))


def test_a_law_with_a_part_is_driven_and_the_same_law_behind_predict_is_asked(make_vec, monkeypatch):
    module, ran = importlib.import_module("smo_gym.evaluation.rollout"), []
    for name in ("driven", "asked"):
        driver = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, name=name, driver=driver: ran.append(name) or driver(*given))
    both(make_vec, LQR(K[HANGING]), SlidingModeObserver(), n=2, horizon=0.1)
    assert ran == ["driven", "asked", "asked"]


@pytest.mark.parametrize("environment", K)
@pytest.mark.parametrize("control_period", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("kind", ["lqr", "smc"])
@pytest.mark.parametrize(
    ("limits", "failures"),
    [({}, "none"), ({"track_limit": 0.2}, "some"), ({"angle_limit": 0.2}, "some"), ({"track_limit": 1e-9}, "all")],
    ids=["no limit", "short track", "small angle", "no track"],
)
def test_both_drivers_give_the_same_bits(make_vec, environment, control_period, kind, limits, failures):
    observers = [SlidingModeObserver(compensation=slot % 2 == 0) for slot in range(SLOTS)]
    result = both(
        make_vec,
        law_of(kind, environment, control_period),
        observers,
        environment=environment,
        control_period=control_period,
        horizon=0.1 if failures == "some" else 0.4,
        options={"state": starts(0.25)},
        **{"track_limit": None, "angle_limit": None} | limits,
    )
    failed = {"none": 0, "all": SLOTS}.get(failures, np.count_nonzero(result.failed))
    assert np.count_nonzero(result.failed) == failed
    assert failures != "some" or 0 < failed < SLOTS


_STEEP = {"m1": (100.0, 100.0), "beta_1": (1e6, 1e6), "beta_2": (1e3, 1e3)}
_EXACT = {"slopes": (math.inf, math.inf), "time_constant": 0.001}
ESTIMATES = {
    "runs away": SlidingModeObserver(xhat0=(0.0, 0.8, 0.0, 60.0)),
    "too large at once": SlidingModeObserver(xhat0=(0.0, 0.8, 0.0, 6e6)),
    "not finite after a period": SlidingModeObserver(xhat0=(0.0, 0.0, 0.0, 1e80)),
    "chatters": SlidingModeObserver(_STEEP, **_EXACT),
    "chatters and is lost": SlidingModeObserver(_STEEP, xhat0=(0.0, 0.0, 0.0, 1e80), **_EXACT),
}


@pytest.mark.parametrize("kind", ["lqr", "smc"])
@pytest.mark.parametrize("estimate", ESTIMATES)
@pytest.mark.parametrize("trace_every", [None, 1, 7])
def test_estimates_that_diverge_give_the_same_bits(make_vec, kind, estimate, trace_every):
    observers = [ESTIMATES[estimate] if slot % 5 else SlidingModeObserver() for slot in range(SLOTS)]
    result = both(make_vec, law_of(kind, HANGING, 0.02), observers, horizon=2.0, trace_every=trace_every)
    assert kind == "smc" or result.failed.any()  # whose forces are too weak to drive all of these away
    assert not result.failed[::5].any()


@block
def _lost_in_time(signals, own, lanes):
    for i in range(lanes):
        age = at(own, 0, i) + 1.0
        put(own, 0, i, age)
        put(signals, XHAT, i, at(signals, Y, i))
        put(signals, XHAT + 1, i, at(signals, Y + 1, i) if age < at(own, 1, i) else math.nan)


class LostInTime(Compiling):
    """Begins with what is measured, and is lost after so many samples."""

    def __init__(self, samples):
        self.samples = samples

    def part(self, n, dt, force, nominal):
        return Part(columns(n, 0.0, self.samples), sample=_lost_in_time)


def test_an_estimate_that_is_lost_starts_anew_where_the_encoders_are_in_both(make_vec):
    observers = [LostInTime(50.0 * (slot + 1)) for slot in range(SLOTS)]
    result = both(make_vec, LQR(K[HANGING]), observers, horizon=1.0, trace_every=1)
    assert result.failed.tolist() == [50 * (slot + 1) <= 1000 for slot in range(SLOTS)]
    assert (result.traces.xhat[-1, :2, 0] == result.traces.x[-1, :2, 0]).all()


@pytest.mark.parametrize("kind", ["lqr", "smc"])
@pytest.mark.parametrize("scale", [1e5, 1e80, 1e160])
@pytest.mark.parametrize("limits", [{}, {"force_limit": None, "track_limit": None}], ids=["limits", "no limit"])
@pytest.mark.parametrize("trace_every", [None, 1, 7])
def test_extreme_states_give_the_same_bits(make_vec, kind, scale, limits, trace_every):
    x = starts(1.0)
    x[::3] *= scale
    observer = SlidingModeObserver()
    result = both(
        make_vec,
        law_of(kind, HANGING, 0.005),
        observer,
        horizon=0.4,
        control_period=0.005,
        options={"state": x},
        trace_every=trace_every,
        **limits,
    )
    assert result.failed[::3].all()
    assert not result.failed[1::3].any()


def test_what_is_not_a_number_is_left_out_of_the_peaks_of_the_state_and_kept_in_those_of_the_estimate():
    loop = Loop(2, 1, {"metrics": metrics.USUAL.part(2)})
    loop.begin(slice(None), np.full((4, 2), 2.0))
    loop.x[:, 1] = loop.xhat[:, 1] = math.nan
    loop.run()
    values = metrics.USUAL.finish(loop.own("metrics"), 0.02)
    found = dict(zip(metrics.names(), values[:, 1].tolist(), strict=True))
    assert [name for name in found if name.startswith("peak") and math.isnan(found[name])] == [
        "peak_estimate_theta",
        "peak_estimate_h_dot",
        "peak_estimate_theta_dot",
    ]
    assert found["peak_h_dot"] == 0.0
    assert np.isfinite(values[:, 0]).all()


def test_a_force_that_is_not_finite_is_an_error_in_both(make_vec):
    # by design the compiled driver, which sees it later, names the law, too
    observer = SlidingModeObserver(xhat0=(0.0, 0.0, 0.0, 1e200))
    law = law_of("smc", HANGING, 0.02)
    for agent, named in ((law, r"smo_gym\.controllers\.sliding_mode:SlidingModeController: "), (Asked(law), "^")):
        env = VectorObserverWrapper(make_vec(3, autoreset_mode="Disabled", horizon=1.0), observer)
        with pytest.raises(ValueError, match=rf"{named}action=nan \(slot 0\) must be finite"):
            rollout(env, agent, seed=0)


def test_what_a_failed_run_shows_does_not_depend_on_the_others(make_vec):
    x = starts(1.0)
    x[:60] = [6.0, 0.1, 0.0, 0.0]  # off the track
    found = []
    for n in (1, 60, SLOTS):
        env = VectorObserverWrapper(make_vec(n, autoreset_mode="Disabled", horizon=1.0), SlidingModeObserver())
        found.append(rollout(env, LQR(K[HANGING]), seed=0, options={"state": x[:n]}, trace_every=5).traces)
    for name in ("x", "xhat", "u", "u_low", "u_high", "u_mean"):
        alone, block_of_them, beside = (getattr(traces, name)[..., 0] for traces in found)
        same(alone, block_of_them, name)
        same(alone, beside, name)
