"""Reaching laws on sigma' = v + d, against what their theorems say."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from smo_gym.controllers import Condition, Reaching
from smo_gym.kernels import plain

STEP = 0.01


def follow(law, sigma, seconds, d=lambda t: 0.0, h=STEP):
    """Sigma and v at each step; the plant is exact for v and d held over it."""
    reach, z, found = plain(law.kernels[0]), 0.0, []
    for k in range(round(seconds / h)):
        v, z = reach(sigma, z, h, law.k1, law.k2)
        found.append((sigma, v))
        sigma += h * (v + d((k + 0.5) * h))
    return np.array(found)


@pytest.mark.parametrize(
    "law", [Reaching.super_twisting(4.0), Reaching.super_twisting(4.0, "predicting"), Reaching("sign", 2.0)]
)
def test_implicit_steps_reach_zero_and_stay_there(law):
    """Within rounding, and the rate is then none: no chatter; Euler's explicit steps never settle."""
    sigma, v = follow(law, 1.0, 5.0).T
    assert np.abs(sigma[300:]).max() < 1e-12
    assert np.abs(v[300:]).max() < 1e-9
    explicit = Reaching(law.kind, law.k1, law.k2, "explicit")
    _, chatter = follow(explicit, 1.0, 5.0).T
    assert np.abs(np.diff(chatter[300:])).sum() > 5.0


def test_gains_ten_times_as_large_do_not_make_implicit_steps_chatter():
    """Of a disturbance's own variation, 4 rad/s of amplitude 1 over 3 s, hardly more is left."""
    disturbed = {"d": lambda t: math.sin(4.0 * t), "seconds": 5.0}
    variations = []
    for L in (5.0, 50.0):
        _, v = follow(Reaching.super_twisting(L), 0.0, **disturbed).T
        variations.append(np.abs(np.diff(v[200:])).sum())
    own = np.abs(np.diff(np.sin(4.0 * np.arange(2.0, 5.0, STEP)))).sum()
    assert variations == pytest.approx([own, own], rel=0.05)


@pytest.mark.parametrize("scheme", ["implicit", "predicting", "explicit"])
def test_small_steps_follow_the_differential_equation(scheme):
    """Before sigma reaches 0, where right-hand sides are smooth; an adaptive solver of order 8 is the judge."""
    law = Reaching(k1=1.5, k2=1.1, scheme=scheme)

    def rhs(t, x):
        return [-law.k1 * math.sqrt(abs(x[0])) * np.sign(x[0]) + x[1], -law.k2 * np.sign(x[0])]

    exact = solve_ivp(rhs, (0.0, 0.5), [2.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    errors = [abs(follow(law, 2.0, 0.5 + h, h=h)[-1, 0] - exact) for h in (1e-2, 1e-3)]
    assert errors[1] < 0.12 * errors[0]
    assert errors[1] < 1e-3


def test_proportional_integral_is_the_linear_filter_that_it_says():
    """A double pole at -omega: sigma of a unit step of d peaks at 1 / (omega e)."""
    sigma, _ = follow(Reaching.pi(8.0), 0.0, 3.0, d=lambda t: 1.0, h=1e-5).T
    assert sigma.max() == pytest.approx(1.0 / (8.0 * math.e), rel=1e-3)
    assert abs(sigma[-1]) < 1e-6


def test_a_boundary_layer_leaves_what_its_width_says():
    """|sigma| = k2 |d| / k1."""
    sigma, _ = follow(Reaching("layer", 5.0, 0.3), 0.0, 3.0, d=lambda t: 2.0).T
    assert sigma[-1] == pytest.approx(0.3 * 2.0 / 5.0)


@pytest.mark.parametrize("L", [0.5, 2.0, 40.0])
def test_levants_gains_meet_the_conditions_and_stand_the_disturbance(L):
    """d' = L sgn of a square wave, the worst there is: h d_k is left, or h (d_k - d_{k-1}) where d is predicted."""

    def triangle(t):
        return L * (0.5 - abs((t % 2.0) - 1.0))

    assert all(each.holds for each in Reaching.super_twisting(L).conditions(L))
    implicit, predicting = (
        np.abs(follow(Reaching.super_twisting(L, scheme), 0.0, 10.0, d=triangle)[300:, 0]).max()
        for scheme in ("implicit", "predicting")
    )
    assert implicit == pytest.approx(STEP * 0.5 * L, rel=0.02)
    assert predicting == pytest.approx(STEP**2 * L)


def test_a_disturbance_faster_than_k2_carries_sigma_away():
    """A broken condition: d grows by 2 k2 a second, z follows at k2, and k1 sqrt|sigma| must make up for the rest."""
    law = Reaching.super_twisting(1.0)
    broken = law.conditions(2.2)
    assert [each.name for each in broken if not each.holds] == ["k2 > L", "k1 > sqrt(k2 + L)"]
    assert broken[0].margin == pytest.approx(1.1 - 2.2)
    sigma, _ = follow(law, 0.0, 10.0, d=lambda t: 2.2 * t).T

    def rhs(t, x):
        return [-1.5 * math.sqrt(abs(x[0])) * np.sign(x[0]) + x[1] + 2.2 * t, -1.1 * np.sign(x[0])]

    exact = solve_ivp(rhs, (0.0, 10.0 - STEP), [1e-9, 0.0], rtol=1e-9, atol=1e-12).y[0, -1]
    assert exact > 10.0
    assert sigma[-1] == pytest.approx(exact, rel=1e-2)


def test_a_smaller_gain_tightens_both_conditions():
    law = Reaching.super_twisting(2.0)
    assert all(a.margin > b.margin for a, b in zip(law.conditions(2.0), law.conditions(2.0, 0.8), strict=True))
    assert not all(each.holds for each in law.conditions(2.0, 0.8))


def test_gains_that_break_a_condition_are_warned_of_by_name():
    with (
        pytest.warns(UserWarning, match=r"super-twisting with k1=1, k2=1 breaks k2 > L for L=2, by 1"),
        pytest.warns(UserWarning, match=r"k1 > sqrt\(k2 \+ L\)"),
    ):
        Reaching(k1=1.0, k2=1.0, L=2.0)
    with pytest.warns(UserWarning, match=r"k1 > \|d\|"):
        Reaching("sign", 1.0, L=1.5)


def test_conditioned_integral_goes_to_what_acts():
    """At the limit z moves by k2 a second towards the rate that acts, and not past it."""
    hold = plain(Reaching(k1=1.5, k2=2.0).kernels[1])
    assert hold(5.0, 1.0, 0.1, 2.0) == pytest.approx(4.8)
    assert hold(1.1, 1.0, 0.1, 2.0) == 1.0
    assert plain(Reaching(k1=1.5, k2=2.0, conditioned=False).kernels[1])(5.0, 1.0, 0.1, 2.0) == 5.0


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"kind": "magic"}, "kind of reaching law"),
        ({"scheme": "proper"}, "scheme"),
        ({"kind": "layer", "scheme": "predicting"}, "must be 'implicit'"),
        (
            {"kind": "pi", "scheme": "explicit"},
            "scheme='explicit' of a reaching law of the kind 'pi' must be 'implicit'",
        ),
        ({"k1": 0.0}, "k1"),
        ({"k2": math.nan}, "k2"),
        ({"L": -1.0}, "L"),
    ],
)
def test_bad_settings_are_refused(settings, told):
    with pytest.raises(ValueError, match=told):
        Reaching(**settings)
    assert Condition("c", 0.0).holds is False
