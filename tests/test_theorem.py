"""Theorem 1 as numbers: suprema against random search, times and layers against cases worked out by hand."""

import math

import numpy as np
import pytest

from smo_gym import LQR, CartPendulum, Gains, SlidingModeController, SlidingModeObserver, theorem
from smo_gym.evaluation import configs
from smo_gym.evaluation.theorem_on_runs import converge
from smo_gym.theorem import OperatingSet

SET = OperatingSet(theta=0.7, speed=(1.7, 5.2), speed_hat=(6.0, 6.0), uncertainty=0.2)


def test_no_random_point_exceeds_the_suprema_and_some_come_near():
    rng = np.random.default_rng(0)
    bounds = theorem.suprema(SET)
    n = 20_000
    x = rng.uniform(-1, 1, (4, n)) * np.array([[1.0], [0.7], [1.7], [5.2]])
    xhat = rng.uniform(-1, 1, (4, n)) * np.array([[1.0], [0.7], [6.0], [6.0]])
    largest = np.zeros((2, 2))
    model = CartPendulum()
    for corner in np.concatenate(
        [rng.uniform(-0.2, 0.2, (100, 3)), 0.2 * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8).T]
    ):
        plant = model.perturbed(corner)
        drift = np.abs(plant.drift(x) - model.drift(xhat))[2:].max(axis=1)
        gain = np.abs(plant.gain(x) - model.gain(xhat))[2:].max(axis=1)
        largest = np.maximum(largest, [drift, gain])
    assert (largest <= [bounds.drift, bounds.gain]).all()
    assert (largest >= 0.85 * np.array([bounds.drift, bounds.gain])).all()


def test_along_a_trajectory_the_suprema_are_those_of_its_points():
    rng = np.random.default_rng(0)
    x, xhat, plant = rng.normal(size=(4, 9)), rng.normal(size=(4, 9)), CartPendulum().perturbed([0.1, 0.1, -0.1])
    along = theorem.suprema_along(x, xhat, plant)
    differences = [np.abs(plant.drift(a) - CartPendulum().drift(b))[2:] for a, b in zip(x.T, xhat.T, strict=True)]
    np.testing.assert_allclose(along.drift, np.max(differences, axis=0))
    np.testing.assert_allclose(along.speed, np.abs(x[2:]).max(axis=1))


def test_designed_gains_satisfy_the_conditions_and_the_printed_ones_do_not():
    bounds = theorem.suprema(SET)
    designed = theorem.conditions(theorem.design(SET), bounds)
    assert [condition.name for condition in designed] == ["(28)", "(30)", "(31)"]
    assert all(condition.literal and condition.by_row.all() for condition in designed)
    assert not any(
        condition.literal for column in ("lqr", "smc") for condition in theorem.conditions(Gains.of(column), bounds)
    )
    barely = theorem.conditions(theorem.design(SET, margin=1e-9), bounds)
    assert all(condition.literal for condition in barely)


def test_the_stable_step_is_the_longest_that_divides_the_sampling_period():
    observer = theorem.stable(theorem.design(SET), (200.0, 100.0), 0.001, 60.0)
    parts = round(0.001 / observer.step)
    assert observer.step <= observer.largest_step(60.0) < 0.001 / (parts - 1)
    observer.start(1, 0.001, 60.0, CartPendulum())


def test_layers_and_times():
    assert theorem.layer([1.0], 2.0, 10.0)[0] == pytest.approx(math.atanh(0.5) / 10.0)
    assert theorem.layer([3.0], 2.0, 10.0)[0] == math.inf
    assert theorem.reaching_time([-0.6], [3.0], [1.0])[0] == pytest.approx(0.3)
    assert theorem.reaching_time([0.6], [1.0], [1.0])[0] == math.inf


def test_condition_52_fails_where_s_vanishes():
    law = SlidingModeController((1.4, 3.4, 3.3, 0.8), 0.001, 33.3)
    rng = np.random.default_rng(0)
    xhat = rng.normal(size=(4, 50))
    push, needed = theorem.controllability(law, xhat)

    def s(x):
        return 0.5 * (1.4 * x[0] + 3.3 * x[2]) ** 2 + 0.5 * (3.4 * x[1] + 0.8 * x[3]) ** 2

    step = 1e-6
    model = CartPendulum()
    along_g = (s(xhat + step * model.gain(xhat)) - s(xhat - step * model.gain(xhat))) / (2 * step)
    along_f = (s(xhat + step * model.drift(xhat)) - s(xhat - step * model.drift(xhat))) / (2 * step)
    np.testing.assert_allclose(push, 26.0 * np.abs(along_g), rtol=1e-6)
    np.testing.assert_allclose(needed, np.abs(along_f) + 30.0, rtol=1e-6)
    push, needed = theorem.controllability(law, np.zeros((4, 1)))
    assert push[0] == 0.0
    assert needed[0] == 30.0


def test_errors_are_in_their_layers_when_the_theorem_says_so():
    rng = np.random.default_rng(0)
    n = 40
    starts = rng.uniform([-0.5, -0.5, -0.1, -0.1], [0.5, 0.5, 0.1, 0.1], (n, 4))
    plants = np.array([CartPendulum().draw(0.2, rng).as_array() for _ in range(n)])
    observers = {
        "designed": theorem.stable(theorem.design(SET), (200.0, 100.0), 0.001, 60.0),
        "sluggish": theorem.stable(Gains((2.0, 2.0), (0.1, 0.1), (1.0, 0.5)), (12.5, 12.5), 0.001, 60.0),
    }
    agent = LQR([7.197, -4.026, 10.96, -0.9999])
    found = converge(observers, agent, SET, starts, plants, force=60.0, horizon=3.0, settle=1.5)
    assert found.tested.mean() > 0.9
    assert found.kept[found.tested].all()
    assert not converge(observers, agent, SET, starts, plants, force=60.0, horizon=0.02, settle=0.0).tested.all()
    assert (found.promised < 1.0).all()
    assert (found.velocity_rms["designed"] < 0.2 * found.velocity_rms["sluggish"]).all()
    # and the check can fail: gains that break (28) do not keep what a smaller set would let them promise
    slow = {"sluggish": observers["sluggish"]}
    with pytest.raises(ValueError, match="m1 must exceed the speeds"):
        converge(slow, agent, SET, starts, plants, force=60.0, horizon=1.0, settle=0.5)
    tight = OperatingSet(theta=0.7, speed=(1.0, 1.0), speed_hat=(6.0, 6.0), uncertainty=0.2)
    failing = converge(slow, agent, tight, starts, plants, force=60.0, horizon=3.0, settle=1.5)
    assert not failing.stayed.all()
    assert not failing.kept.all()


def test_what_holds_with_tanh_holds_on_random_runs():
    rng = np.random.default_rng(1)
    n, force = 100, 60.0
    starts = rng.uniform([-0.5, -0.5, -0.1, -0.1], [0.5, 0.5, 0.1, 0.1], (n, 4))
    plants = np.array([CartPendulum().draw(0.2, rng).as_array() for _ in range(n)])
    observer = theorem.stable(theorem.design(SET), (200.0, 100.0), 0.001, force)
    agent = LQR([7.197, -4.026, 10.96, -0.9999])
    found = converge({"designed": observer}, agent, SET, starts, plants, force=force, horizon=3.0, settle=1.0)
    assert found.stayed.all()
    assert found.bounded.all()
    assert (found.velocity_settled < found.velocity_bound[:, None]).all()
    rows = np.array([[1.0, 1.0], [0.0, 0.0]])
    assert np.isinf(theorem.velocity_bound(SlidingModeObserver(gains="lqr"), SET, force)).any()
    assert theorem.position_bound(rows, 2.0, 10.0, 0.5)[1, 0] == pytest.approx(math.atanh(0.25) / 10.0)


def test_at_constant_speed_the_layer_is_reached_in_the_end_only_and_the_bound_in_time():
    """e' = V - m1 tanh(k e), worked out by Euler's method: (43) is not what tanh promises."""
    V, m1, k, dt = 1.7, 6.02, 200.0, 1e-6
    kappa = 0.5 * (m1 - V)
    e0 = 0.5
    t0, layer = e0 / (m1 - V), float(theorem.layer(V, m1, k))
    errors = [e0]
    for _ in range(round(e0 / kappa / dt)):
        errors.append(errors[-1] + dt * (V - m1 * math.tanh(k * errors[-1])))
    assert errors[round(t0 / dt)] > 1.5 * layer
    assert errors[-1] <= float(theorem.position_bound(V, m1, k, kappa))


def test_no_random_acceleration_exceeds_its_bound():
    rng = np.random.default_rng(2)
    bound = theorem.acceleration(SET, 60.0)
    x = rng.uniform(-1, 1, (4, 20_000)) * np.array([[1.0], [0.7], [1.7], [5.2]])
    for corner in rng.choice([-0.2, 0.2], (30, 3)):
        plant = CartPendulum().perturbed(corner)
        assert (np.abs(plant.drift(x) + plant.gain(x) * 60.0)[2:].max(axis=1) <= bound).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"theta": 0.0}, "theta=0.0 must be a finite number greater than 0"),
        ({"speed": (0.0, 1.0)}, "the operating set holds no point"),
        ({"speed_hat": (1.0,)}, r"speed_hat has shape \(1,\)"),
        ({"uncertainty": 1.0}, r"uncertainty=1\.0 must be a fraction in \[0, 1\)"),
    ],
)
def test_bad_sets_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        OperatingSet(**{"theta": 0.7, "speed": (1.0, 1.0), "speed_hat": (1.0, 1.0), "uncertainty": 0.1} | change)


def test_margins_are_positive():
    with pytest.raises(ValueError, match=r"margin=0\.0 must be a finite number greater than 0"):
        theorem.design(SET, 0.0)


@pytest.mark.slow
def test_the_command(command, tmp_path):
    shown = command("theorem", "--runs", "30", "--out", tmp_path).stdout
    assert max(map(len, shown.splitlines()[:-1])) <= 100
    assert "designed, 3 of 3. RMS errors" in " ".join(shown.split())
    assert shown.endswith(f"theorem.txt is in {tmp_path}\n")
    text = (tmp_path / "theorem.txt").read_text()
    assert "30 of 30 were inside the layer of both positions by the time of (43)" in text
    assert "30 of 30 kept |e| <= atanh((V + kappa) / m1) / k_p from |e(0)| / kappa on, kappa = 0.5" in text
    assert "In the end |X2 - X2hat| is at most (0.0215, 0.239) m/s, rad/s" in text
    assert "designed gains, printed runs' slopes" in text
    assert "(51): least |ds/dx g|" in text
    assert "LQR, case 4" in text  # conditions along runs
    changes = (
        ("margin:", "margn:", "did you mean 'margin'?"),
        ("[-0.5, -0.5,", "[0.6, -0.5,", "the set of initial states holds no point"),
        ("settle: {value: 2.0", "settle: {value: 9.0", "settle=9.0 must lie between 0 and horizon=6.0"),
    )
    settings = configs.path("theorem").read_text()
    for old, new, message in changes:
        (tmp_path / "bad.yaml").write_text(settings.replace(old, new))
        bad = command("theorem", "--runs", "30", "--config", tmp_path / "bad.yaml", check=False)
        assert bad.returncode == 2
        assert message in bad.stderr
