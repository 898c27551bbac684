"""Implicit steps: measurements made from a solution of the inclusion must lead back to it."""

import numpy as np
import pytest

from smo_gym.kernels.elementary import cube_root_above
from smo_gym.kernels.twisting import homogeneous, implicit, positive_root

RNG = np.random.default_rng(0)
H, L = 10.0 ** RNG.uniform(-4, -1, 300), 10.0 ** RNG.uniform(-1, 4, 300)
SIDE = RNG.choice([-1.0, 1.0], 300)


@pytest.mark.parametrize("slides", [True, False])
def test_a_step_of_super_twisting_solves_its_inclusion(slides):
    e = 0.0 * H if slides else SIDE * 10.0 ** RNG.uniform(-8, 1, 300)
    xi = RNG.uniform(-1, 1, 300) if slides else SIDE
    add_v = H * 1.1 * L * xi
    add_q = H * (1.5 * np.sqrt(L * abs(e)) * np.sign(e) + add_v)
    found = np.array([*map(implicit, 0.0 * H, e + add_q, H, L)]).T
    assert found[0] == pytest.approx(add_q, rel=1e-12, abs=1e-14)
    assert found[1] == pytest.approx(add_v, rel=1e-11)
    assert found[2] == pytest.approx(1.1 * L * xi, rel=1e-11)


@pytest.mark.parametrize("slides", [True, False])
def test_a_step_of_third_order_solves_its_inclusion(slides):
    s = 0.0 * H if slides else SIDE * 10.0 ** RNG.uniform(-3, 0.3, 300)
    xi = RNG.uniform(-1, 1, 300) if slides else SIDE
    c_1, c_2, c_3 = 2.0 * np.cbrt(L), 2.12 * np.cbrt(L) ** 2, 1.1 * L
    before = RNG.normal(size=300) * np.sqrt(L)
    a = before + H * c_3 * xi
    add_v = H * (c_2 * s + a)
    add_q = H * (c_1 * s * abs(s) + add_v)
    found = np.array([*map(homogeneous, 0.0 * H, before, s**3 + add_q, H, c_1, c_2, c_3)]).T
    scale = abs(add_q) + abs(s**3) + H * H * abs(before)  # of what cancels
    assert (abs(found[0] - add_q) < 1e-10 * scale).all()
    assert (abs(found[1] - add_v) < 1e-10 * scale / H).all()
    assert (abs(found[2] - a) < 1e-10 * scale / H**2).all()


def test_the_root_of_its_cubic_is_exact_from_any_size_to_any_other():
    n = 20_000
    h, L, c = 10.0 ** RNG.uniform(-5, -1, n), 10.0 ** RNG.uniform(-2, 6, n), 10.0 ** RNG.uniform(-12, 4, n)
    a, b, c = h * 2.0 * L ** (1 / 3), h * h * 2.12 * L ** (2 / 3), np.append(c[:-1], 0.0)
    s = np.array([*map(positive_root, a, b, c)])
    assert ((s + a) * s + b) * s == pytest.approx(c, rel=1e-14, abs=0.0)


def test_a_third_of_the_bits_is_above_the_cube_root():
    x = np.append(10.0 ** RNG.uniform(-300, 300, 20_000), 2.0 ** np.arange(-60, 60))
    ratio = np.array([*map(cube_root_above, x)]) / np.cbrt(x)
    assert 1.0 <= ratio.min() < ratio.max() < 1.08
    assert 0.0 <= cube_root_above(0.0) < 1e-100
