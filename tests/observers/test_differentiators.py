"""Differentiators, without and with a model: what is exact, what chatters, what noise does."""

import numpy as np
import pytest

from smo_gym.kernels import inlined
from smo_gym.models import Model
from smo_gym.observers import (
    BackwardDifference,
    FilteredDerivative,
    HighGain,
    Homogeneous,
    Levant,
    SuperTwisting,
)

H = 0.01
T = H * np.arange(1500)
LATE = slice(500, None)
ALL = (
    BackwardDifference(),
    FilteredDerivative(),
    HighGain(),
    HighGain(use_model=False),
    *(Levant(scheme=scheme) for scheme in ("explicit", "implicit", "proper")),
    *(SuperTwisting(scheme=scheme) for scheme in ("explicit", "implicit", "proper")),
    Homogeneous(),
    Homogeneous(use_model=False),
)


@inlined
def _falling(x, s, inputs):
    """Two bodies that u accelerates, the second less; the first feels a push that only some are told of."""
    _, _, v, w = x
    u, push = inputs
    return v, w, u + push, 0.5 * u


FALLING, TOLD = Model(_falling, (0.0,)), Model(_falling, (2.0,))


def _pair(noise):
    return np.column_stack([0.5e-4 * np.arange(len(noise)) + noise] * 2)


def run(observer, signal, u=None, **settings):
    y = np.column_stack([signal, signal])
    return observer.run(T[: len(signal)], y, np.zeros(len(signal)) if u is None else u, **settings)


def test_backward_and_filtered_derivatives_are_their_formulas():
    y = np.random.default_rng(0).normal(size=(60, 2))
    t = np.cumsum(np.random.default_rng(1).uniform(0.5, 2.0, 60)) * H  # uneven
    difference = BackwardDifference().run(t, y, np.zeros(60))
    assert difference[1:, 2:] == pytest.approx(np.diff(y, axis=0) / np.diff(t)[:, None], rel=1e-6)
    cutoff = np.array([30.0, 90.0])
    v = np.zeros(2)
    found = FilteredDerivative(cutoff).run(t, y, np.zeros(60))
    for k in range(1, 60):
        v = (v + cutoff * (y[k] - y[k - 1])) / (1.0 + cutoff * (t[k] - t[k - 1]))
        assert found[k, 2:] == pytest.approx(v, rel=1e-6)


def test_high_gain_errors_decay_with_the_bandwidth():
    """Exactly double poles at exp(-w h) where the model is exact, at uneven samples of a linear plant, too."""
    w, t = 8.0, T[:200]
    x = np.column_stack([0.5 * t**2, 0.25 * t**2, t, 0.5 * t])
    xhat = HighGain(bandwidth=(w, w)).run(t, x[:, :2], np.ones(200), model=FALLING)
    e = (x - xhat)[:, 2]
    # the error starts in neither eigenvector: fit (a + b k) exp(-w h k)
    k = np.arange(20, 200)
    a = np.column_stack([np.exp(-w * H * k), k * np.exp(-w * H * k)])
    rest = e[20:] - a @ np.linalg.lstsq(a, e[20:], rcond=None)[0]
    assert np.abs(rest).max() < 1e-9
    assert abs(e[-1]) < 1e-4
    largest = run(HighGain(bandwidth=(1e9, 1e9), use_model=False), np.sin(T))
    assert largest[1:, 2] == pytest.approx(np.diff(np.sin(T)) / H, abs=1e-9)


@pytest.mark.parametrize(("make", "c"), [(Levant, 3.0), (SuperTwisting, 2.0)])
def test_a_parabola_tells_the_schemes_apart(make, c):
    """The explicit one chatters, the implicit one is h c / 2 off, the proper one has neither."""
    x = 0.5 * c * T**2
    model = {} if make is Levant else {"model": FALLING}  # it lacks the push of 2 m/s^2
    e = {
        scheme: (run(make((5.0, 5.0), scheme), x, **model)[:, 2] - c * T)[LATE]
        for scheme in ("explicit", "implicit", "proper")
    }
    assert np.ptp(e["explicit"]) > H
    assert e["implicit"] == pytest.approx(-0.5 * H * c, abs=1e-9)
    assert e["proper"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scheme", ["implicit", "proper"])
def test_an_implicit_step_reaches_zero_in_finite_time_and_stays(scheme):
    line = 0.3 - 0.7 * T
    xhat = run(Levant((4.0, 4.0), scheme), line)
    e = np.abs(xhat[:, 2] + 0.7)
    first = len(e) - int(np.argmax(e[::-1] > 1e-11))  # zero from here on
    assert 5 < first < 150
    assert np.abs(np.diff(xhat[first:, 2])).sum() < 1e-9  # no chatter
    assert np.abs(np.diff(run(Levant((4.0, 4.0), "explicit"), line)[first:, 2])).sum() > 1.0


@pytest.mark.parametrize("scheme", ["explicit", "implicit", "proper"])
def test_levants_error_grows_as_the_square_root_of_the_noise(scheme):
    """Over three decades of the bound of worst-case noise, L = 1."""
    t = 1e-4 * np.arange(60_000)
    bounds = np.logspace(-6, -3, 7)
    errors = []
    for eps in bounds:
        # the worst of noises that oscillate near the rate that L and eps allow, and of one without any pattern
        noises = [eps * np.sin(t * np.sqrt(share / eps)) for share in (0.2, 0.5, 0.8, 2.0, 5.0)]
        noises.append(np.random.default_rng(0).uniform(-eps, eps, len(t)))
        worst = [
            np.abs(Levant((1.0, 1.0), scheme).run(t, y, 0.0 * t)[20_000:, 2] - 0.5).max() for y in map(_pair, noises)
        ]
        errors.append(max(worst))
    slope = np.polyfit(np.log(bounds), np.log(errors), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.05)


def test_a_model_is_worth_what_it_knows():
    x = 0.5 * 2.0 * T**2
    lacking = run(SuperTwisting((0.5, 5.0)), x, model=FALLING)[-1, 2] - 2.0 * T[-1]
    told = run(SuperTwisting((0.5, 5.0)), x, model=TOLD)[-1, 2] - 2.0 * T[-1]
    assert abs(lacking) > 1.0  # a bound below what the model lacks
    assert told == pytest.approx(0.0, abs=1e-9)


def test_the_third_order_one_is_exact_on_cubics():
    c = 3.0
    xhat = run(Homogeneous((40.0, 40.0), use_model=False), c * T**3 / 6.0)
    e = (xhat[:, 2] - 0.5 * c * T**2)[LATE]
    # exact for parabolas; of a cubic the jerk's h^2 c / 3 is left over
    assert np.ptp(e) < 1e-8
    assert np.abs(e).max() < c * H**2
    parabola = run(Homogeneous((40.0, 40.0), use_model=False), 0.5 * c * T**2)
    assert parabola[LATE, 2] == pytest.approx(c * T[LATE], abs=1e-8)


def test_in_sliding_the_proper_ones_are_the_three_point_formula():
    """What Seeber's outputs are of second order: exact for parabolas, the error of others of second order in h."""
    y = np.sin(T)
    first, third = np.diff(y) / H, (3.0 * y[2:] - 4.0 * y[1:-1] + y[:-2]) / (2.0 * H)
    for observer, formula in (
        (Levant((4.0, 4.0), "implicit"), first),
        (Levant((4.0, 4.0), "proper"), third),
        (Homogeneous((4.0, 4.0), use_model=False), third),
    ):
        assert run(observer, y)[LATE, 2] == pytest.approx(formula[-len(y[LATE]) :], abs=1e-9)
    assert np.abs(third - np.cos(T[2:])).max() < H**2 / 2.9 < np.abs(first - np.cos(T[1:])).max() / 100


@pytest.mark.parametrize(("scheme", "share"), [("implicit", (0.5, 1.0)), ("proper", (2.0 / 3.0, -1.0))])
def test_what_an_acceleration_that_jumps_costs(scheme, share):
    """The worst that an acceleration within c does, which for "proper" turns 2/3 h before the sample."""
    c, late = 3.0, np.zeros(500)
    worst, early = share
    for k, since in ((-2, H), (-1, 2.0 * H)):
        turned = max(since - 4.0 / 3.0 * H, 0.0)
        late[k] = c * (early * 0.5 * since**2 + (turned**2 if early < 0.0 else 0.0))
    speed = c * (2.0 * H * early + (4.0 / 3.0 * H if early < 0.0 else 0.0))
    error = run(Levant((4.0, 4.0), scheme), late)[-1, 2] - speed
    assert abs(error) == pytest.approx(worst * H * c, rel=1e-9)


@pytest.mark.parametrize("observer", ALL, ids=repr)
def test_a_recording_and_sample_by_sample_are_the_same(observer):
    y = np.column_stack([np.sin(T[:80]), np.cos(T[:80])])
    u = np.sin(3.0 * T[:80])
    whole = observer.run(T[:80], y, u, model=FALLING)
    estimator = observer.start(2, H, 1.0, FALLING)
    estimator.reset(np.ones(2, dtype=bool), np.tile(y[0, :, None], 2))
    for k in range(1, 80):
        estimator.update(np.tile(y[k, :, None], 2)[None], np.full(2, u[k - 1]))
        assert (estimator.xhat == whole[k][:, None]).all()


@pytest.mark.parametrize("observer", ALL, ids=repr)
def test_a_gap_does_no_harm(observer):
    """A line is a line, however it is sampled."""
    keep = np.delete(np.arange(1500), [700, 701, 900, 1100, 1101, 1102])
    y = np.column_stack([0.3 * T, -0.2 * T])[keep]
    xhat = observer.run(T[keep], y, np.zeros(len(keep)), model=FALLING)
    chatter = 0.05 * max(observer.L) if getattr(observer, "scheme", "") == "explicit" else 1e-3
    assert np.abs(xhat[800:, 2:] - [0.3, -0.2]).max() < chatter


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: FilteredDerivative((0.0, 1.0)), "cutoff"),
        (lambda: HighGain(bandwidth=(1.0, -1.0)), "bandwidth"),
        (lambda: HighGain(use_model="yes"), "use_model"),
        (lambda: Levant(L=1.0), "L"),
        (lambda: Levant(scheme="euler"), "scheme"),
        (lambda: SuperTwisting(scheme="proper implicit"), "scheme"),
        (lambda: Homogeneous(L=(np.nan, 1.0)), "L"),
        (lambda: SuperTwisting(model="cart").start(1, H, 1.0, FALLING), "model='cart'"),
    ],
)
def test_settings_that_cannot_be(make, said):
    with pytest.raises(ValueError, match=said):
        make()
