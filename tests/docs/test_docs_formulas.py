"""The formulas of the mathematics page, read from their TeX, are those that the code computes."""

import re

import pytest
import sympy
from conftest import ROOT
from sympy.parsing.sympy_parser import implicit_multiplication, parse_expr, standard_transformations

from smo_gym import CartPendulum
from smo_gym.kernels import plain
from smo_gym.kernels.cart_pendulum import control_affine, energy

PAGE = (ROOT / "docs" / "mathematics.md").read_text(encoding="utf-8")
FORMULAS = re.findall(r"^\$\$ (.*?) \$\$$", PAGE, re.MULTILINE)
M, m, l, g, F, t, v, w = SYMBOLS = sympy.symbols("M m l g F t v w", real=True)
sigma = sympy.Symbol("sigma")
NAMES = {r"\dot\theta": " w ", r"\dot h": " v ", r"\theta": " t ", "M_c": " M ", r"\sigma": " sigma "}
KINDS = (*standard_transformations, implicit_multiplication)


def formula(start):
    """The right-hand side of the one formula that begins so, without its number."""
    (found,) = [candidate for candidate in FORMULAS if candidate.startswith(start)]
    return re.sub(r"\\tag\{\d+\}", "", found.partition("=")[2])


def expression(tex):
    for name, symbol in NAMES.items():
        tex = tex.replace(name, symbol)
    tex = re.sub(r"\\(sin|cos)\^2\s+t", r"\1(t)**2", tex)
    tex = re.sub(r"\\(sin|cos)\s+t", r"\1(t)", tex)
    tex = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", tex).replace("^", "**")
    return parse_expr(tex, {str(s): s for s in (*SYMBOLS, sigma)}, KINDS)


def matrix(tex):
    inside = re.search(r"\\begin\{bmatrix\}(.*)\\end\{bmatrix\}", tex)[1]
    return sympy.Matrix([[expression(cell) for cell in row.split("&")] for row in inside.split(r"\\")])


def same(a, b):
    return sympy.simplify(a - b) == 0


f_h, f_theta, g_h, g_theta = plain(control_affine)(sympy.sin(t), sympy.cos(t), w, M, m, l, g)


@pytest.mark.parametrize(("start", "held"), [(r"\ddot h =", f_h + g_h * F), (r"\ddot\theta =", f_theta + g_theta * F)])
def test_equations_of_motion(start, held):
    assert same(expression(formula(start)), held)


def test_drift_and_gain():
    assert all(map(same, matrix(formula("f(x) = \\begin")), (v, w, f_h, f_theta)))
    assert all(map(same, matrix(formula("g_2(x) =")), (g_h, g_theta)))


def test_energy():
    integrand = re.search(r"\\left\((.*)\\right\)", formula("J ="))[1]
    assert same(expression(integrand), plain(energy)(sympy.cos(t), v, w, M, m, l, g))


@pytest.mark.parametrize(("theta", "sign"), [(0, 1), (sympy.pi, -1)])
def test_linearisation(theta, sign):
    plant = CartPendulum()
    values = dict(zip((M, m, l, g), plant.as_array(), strict=True)) | {sigma: sign}
    for name, held in zip("AB", plant.linearise(float(theta)), strict=True):
        printed = matrix(formula(f"{name} = \\begin")).subs(values)
        assert max(abs(printed - sympy.Matrix(held))) < 1e-12
