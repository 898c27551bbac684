"""Laws beyond the article's, each against what it promises."""

import builtins
import math

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from scipy import linalg, signal

from smo_gym import VectorObserverWrapper
from smo_gym.controllers import (
    LQR,
    IntegralSlidingMode,
    Linear,
    ModelPredictive,
    Reaching,
    SlidingModeController,
    SurfaceControl,
    surface,
)
from smo_gym.evaluation.rollout import rollout
from smo_gym.observers import Oracle
from smo_gym.plant import CartPendulum
from smo_gym.reference import shipped

START = (1.52, 1.18, 0.14, 0.2)
K = (18.0, -25.0, 15.0, -3.0)
POLES = (-0.67, -4.96 + 3.51j, -4.96 - 3.51j)
PERIOD = 0.02


def made(environment="SMOPendulum-v0", n=3, **options):
    given = {"control_period": PERIOD, "horizon": 10.0, "track_limit": 50.0, "uncertainty": 0.0, **options}
    env = gymnasium.make_vec(environment, n, autoreset_mode=AutoresetMode.DISABLED, **given)
    return VectorObserverWrapper(env, Oracle())


def metrics(law, state=START, n=3, plants=None, **options):
    reset = {"state": np.tile(state, (n, 1))}
    if plants is not None:
        reset["params"] = np.array([plant.as_array() for plant in plants])
    found = rollout(made(n=n, **options), law, options=reset, seed=0)
    assert not found.failed.any()
    return found.metrics


class Asked:
    """A law that the harness has to ask once a control period."""

    def __init__(self, law):
        self.law = law

    def predict(self, *args):
        return self.law.predict(*args)


ALL = {
    "linear": lambda: Linear(K, PERIOD, 1.0, 20.0),
    "surface": lambda: SurfaceControl(surface(POLES), PERIOD, Reaching.super_twisting(2.0), 20.0),
    "integral sliding mode": lambda: IntegralSlidingMode(Linear(K, PERIOD, 1.0), PERIOD, limit=20.0),
    "around SMC": lambda: IntegralSlidingMode(
        SlidingModeController([1.4, 3.4, 3.3, 0.8], PERIOD, 1.0), PERIOD, Reaching.pi(8.0), 20.0
    ),
    "implicit SMC": lambda: SlidingModeController([1.4, 3.4, 3.3, 0.8], PERIOD, 1.0, scheme="implicit"),
}


@pytest.mark.parametrize("law", ALL)
def test_a_law_that_is_asked_gives_the_bits_of_the_compiled_loop(law):
    a, b = metrics(ALL[law](), horizon=2.0), metrics(Asked(ALL[law]()), horizon=2.0)
    assert a.keys() == b.keys()
    assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


@pytest.mark.parametrize("law", ALL)
def test_an_estimate_that_is_not_finite_is_not_hidden_by_the_limit(law):
    """It gives a force that is not finite, which the environment refuses, and no other slot's."""
    u, _ = ALL[law]().predict(np.array([[0.1, 0.1, 0.1, 0.1, 0.0, math.nan], [0.1, 0.1, 0.1, 0.1, 0.0, 0.0]]))
    assert np.isnan(u[0, 0])
    assert np.isfinite(u[1, 0])


def test_two_slots_of_a_law_know_nothing_of_each_other():
    law = ALL["integral sliding mode"]()
    together = metrics(law, n=3)
    assert all(np.ptp(values) == 0.0 for values in together.values())


# Linear


def test_without_integral_and_within_its_limit_it_is_lqr():
    a, b = metrics(Linear(K, PERIOD)), metrics(LQR(K))
    assert all(np.array_equal(a[name], b[name]) for name in a)


def test_the_integral_brings_the_cart_home_under_a_constant_force():
    """Without it a spring's error is left, d / K_h."""
    pushed = {"disturbance": {"force": 2.0}, "horizon": 60.0, "state": np.zeros(4), "n": 1}
    without, with_ = (metrics(Linear(K, PERIOD, k_i, 30.0), **pushed)["mse_h"] for k_i in (0.0, 4.0))
    assert without == pytest.approx((2.0 / K[0]) ** 2, rel=0.1)
    assert with_ < 0.1 * without


def test_the_references_force_is_what_tracking_lacked():
    follow = {"environment": "SMOPendulumTracking-v0", "reference": shipped(), "preview": 0, "control_period": 0.001}
    follow |= {"state": shipped().x0, "n": 1}
    alone, told = (metrics(Linear(K, 0.001, model=model), **follow) for model in (None, CartPendulum()))
    assert told["mse_h"] < 1e-2 * alone["mse_h"]
    assert told["mse_theta"] < 1e-2 * alone["mse_theta"]


# Integral sliding mode


@pytest.mark.parametrize("reaching", [Reaching.super_twisting(20.0), Reaching.pi(20.0), Reaching("sign", 4.0)])
def test_a_matched_disturbance_is_as_if_it_were_not_there(reaching):
    """On the true state a sine of 3 N leaves the run that the nominal law makes of the undisturbed plant."""
    law = IntegralSlidingMode(Linear(K, 0.001), 0.001, reaching)
    run = {"control_period": 0.001, "n": 1}
    free, alone, kept = (
        metrics(each, **run, **pushed)
        for each, pushed in (
            (Linear(K, 0.001), {}),
            (Linear(K, 0.001), {"disturbance": {"kind": "sine", "force": 3.0, "frequency": 0.5}}),
            (law, {"disturbance": {"kind": "sine", "force": 3.0, "frequency": 0.5}}),
        )
    )
    assert abs(alone["mse_h"] - free["mse_h"]) > 20.0 * abs(kept["mse_h"] - free["mse_h"])


def test_masses_are_matched_and_the_rods_length_is_not():
    """With other masses the law still makes the nominal run; with another rod it does not."""
    law = IntegralSlidingMode(Linear(K, 0.001), 0.001, Reaching.super_twisting(40.0))
    free = metrics(Linear(K, 0.001), control_period=0.001, n=1)["mse_theta"].item()
    heavy, long = (CartPendulum(cart_mass=4.2, bob_mass=0.38), CartPendulum(rod_length=0.52))
    of = {plant: metrics(law, control_period=0.001, n=1, plants=[plant])["mse_theta"] for plant in (heavy, long)}
    assert of[heavy] == pytest.approx(free, rel=1e-2)
    assert abs(of[long] - free) > 10.0 * abs(of[heavy] - free)


def test_implicit_steps_do_not_chatter_and_explicit_ones_do():
    """The same strong gains at 20 ms."""
    implicit, explicit = (
        metrics(IntegralSlidingMode(Linear(K, PERIOD), PERIOD, Reaching(k1=9.0, k2=2.0, scheme=scheme), 30.0))
        for scheme in ("implicit", "explicit")
    )
    assert (explicit["total_variation"] > 30.0 * implicit["total_variation"]).all()


def test_a_limit_below_the_disturbance_is_refused():
    with pytest.raises(ValueError, match=r"limit=5 N is less than what a disturbance=6 N needs alone"):
        IntegralSlidingMode(Linear(K, PERIOD), PERIOD, limit=5.0, disturbance=6.0)
    assert IntegralSlidingMode(Linear(K, PERIOD), PERIOD, limit=5.0, disturbance=3.0).room().margin == 2.0
    with pytest.raises(ValueError, match=r"nominal='lqr' must be a compiled law"):
        IntegralSlidingMode("lqr", PERIOD)  # type: ignore[arg-type]


# Surfaces


@pytest.mark.parametrize("plant", [CartPendulum(), CartPendulum(gravity=9.8)])
def test_on_the_surface_the_motion_has_the_poles_that_were_asked_for(plant):
    """Of A - B (c B)^-1 c A, by NumPy: the poles, and 0 of s itself."""
    A, B = plant.linearise()
    c = surface(POLES, plant)
    assert (c @ B).item() == pytest.approx(1.0)
    found = np.linalg.eigvals(A - B @ (c[None] @ A) / (c @ B).item())
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.array([*POLES, 0.0])), abs=1e-8)


def test_a_surface_that_nothing_reaches_is_refused():
    with pytest.raises(ValueError, match="not controllable"):
        surface(POLES, CartPendulum(gravity=0.0))
    with pytest.raises(ValueError, match="poles"):
        surface((-1.0, 2.0, -3.0))
    with pytest.raises(ValueError, match="the force does not move s"):
        SurfaceControl([1.0, 1.0, 0.0, 0.0], PERIOD)


def test_the_gain_keeps_its_sign_where_c4_is_less_than_l_c3():
    """Exactly: (c3 - c4 cos theta / l) / (M_c + m sin^2 theta)."""
    l = CartPendulum().rod_length
    good, bad = ([1.0, 1.0, 1.0, share * l] for share in (0.9, 1.1))
    assert SurfaceControl(good, PERIOD).conditions()[0].holds
    assert not SurfaceControl(bad, PERIOD).conditions()[0].holds
    law = SurfaceControl(good, PERIOD)
    assert law.gain([0.0, 1.0, 0.0, 0.0]) == pytest.approx(
        (1.0 - 0.9 * math.cos(1.0)) / (3.5 + 0.32 * math.sin(1.0) ** 2)
    )


def test_a_surface_is_reached_and_kept():
    law = SurfaceControl(surface(POLES), 0.001, Reaching.super_twisting(2.0))
    quiet = metrics(law, control_period=0.001, horizon=35.0, n=1)
    assert quiet["mse_h"] < 0.06
    assert quiet["mse_theta"] < 0.01
    assert quiet["total_variation"] < 200.0


# SMC with an implicit sgn


def test_implicit_smc_varies_the_force_by_less():
    run = {"control_period": 0.001, "n": 1}
    explicit, implicit = (
        metrics(SlidingModeController([1.4, 3.4, 3.3, 0.8], 0.001, math.inf, scheme=scheme), **run)
        for scheme in ("explicit", "implicit")
    )
    assert implicit["total_variation"] < 0.1 * explicit["total_variation"]
    with pytest.raises(ValueError, match="scheme"):
        SlidingModeController([1.4, 3.4, 3.3, 0.8], 0.001, 1.0, scheme="proper")


# MPC

Q, R = (51.8, 57.4, 59.3, 0.284), 1.0


def observation(*states):
    return np.array([[*state[:2], *state] for state in states])


def test_a_plan_without_active_limits_is_sampled_lqrs():
    pytest.importorskip("osqp")
    mpc = ModelPredictive(Q, R, PERIOD, limit=1e4)
    A, B, *_ = signal.cont2discrete((*CartPendulum().linearise(), np.eye(4), np.zeros((4, 1))), PERIOD)
    P = linalg.solve_discrete_are(A, B, np.diag(Q) * PERIOD, [[R * PERIOD]])
    K_d = np.linalg.solve(R * PERIOD + B.T @ P @ B, B.T @ P @ A)[0]
    e = np.array(START)
    assert mpc.predict(observation(START))[0].item() == pytest.approx(-K_d @ e, rel=1e-3)


def test_a_plan_within_limits_beats_clipping_in_its_own_cost():
    """On the linear plant and over the plan's weights; the limit of 4 N is active."""
    pytest.importorskip("osqp")
    mpc, A_B = ModelPredictive(Q, R, PERIOD, limit=4.0), CartPendulum().linearise()
    A, B, *_ = signal.cont2discrete((*A_B, np.eye(4), np.zeros((4, 1))), PERIOD)
    costs = []
    for act in (lambda e: mpc.predict(observation(e))[0].item(), lambda e: float(np.clip(-mpc.K @ e, -4.0, 4.0))):
        e, cost, forces = np.array(START), 0.0, []
        for _ in range(1000):
            forces.append(act(e))
            cost += PERIOD * (e @ (np.array(Q) * e) + R * forces[-1] ** 2)
            e = A @ e + B[:, 0] * forces[-1]
        assert max(map(abs, forces)) <= 4.0
        costs.append(cost)
    assert costs[0] <= costs[1] * 1.0001


def test_a_plan_that_does_not_exist_is_replaced_and_counted():
    pytest.importorskip("osqp")
    mpc = ModelPredictive(Q, R, PERIOD, limit=5.0, track=0.5)
    u, _ = mpc.predict(observation(START, (0.01, 0.01, 0.0, 0.0)))
    assert mpc.fallbacks == 1
    assert u[0, 0] == np.clip(-mpc.K @ np.array(START), -5.0, 5.0)
    assert abs(u[1, 0]) < 5.0


def test_without_osqp_the_extra_is_named(monkeypatch):
    import_ = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name == "osqp":
            raise ImportError(name)
        return import_(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(ImportError, match=r'pip install "smo_gym\[mpc\]"'):
        ModelPredictive(Q, R, PERIOD, limit=5.0)
