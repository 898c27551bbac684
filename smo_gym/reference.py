"""Minimum-energy reference trajectories, equation (53), by direct collocation.

The article used DYNOPT: orthogonal collocation on finite elements with the force constant in each element. So do we,
with CasADi and IPOPT (the extra ``reference``). A solution is its force; the states are what our own plant makes of it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .kernels import plain
from .kernels.cart_pendulum import control_affine, energy
from .loop import Loop
from .plant import CartPendulum, moving
from .typing import Array
from .validation import array, multiple, number, unknown, whole

_DEGREE = 4  # Radau points in a finite element
_LONGEST = 0.05  # s; an element of the force is divided into finite elements no longer than this


class ReferenceNotFound(RuntimeError):
    """The optimiser found no trajectory; the message carries its reason."""


@dataclass(frozen=True, slots=True)
class Reference:
    """A trajectory of the nominal plant from one state to another, then rest.

    Args:
        x0: start, shape (4,).
        xT: end, shape (4,).
        horizon: T in s.
        force_limit: bound of the force in N.
        cost: J of equation (53) in J s.
        u: force in N in each of equally long elements.
        params: [M_c, m, l, g] of the plant that follows it, shape (4,).

    Raises:
        ValueError: a field is of a wrong shape or not allowed.
    """

    x0: tuple[float, ...]
    xT: tuple[float, ...]
    horizon: float
    force_limit: float
    cost: float
    u: tuple[float, ...]
    params: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("x0", "xT", "params"):
            value = array(f"reference {name}", getattr(self, name), (4,))
            object.__setattr__(self, name, tuple(value.tolist()))
        CartPendulum.of(self.params)
        for name in ("horizon", "force_limit"):
            object.__setattr__(self, name, number(f"reference {name}", getattr(self, name), above=0.0))
        object.__setattr__(self, "cost", number("reference cost", self.cost))
        if np.ndim(self.u) != 1 or len(self.u) == 0:
            raise ValueError(f"reference u has shape {np.shape(self.u)}, it must hold one force an element")
        object.__setattr__(self, "u", tuple(array("reference u", self.u, (len(self.u),)).tolist()))

    def trajectory(self, dt: float) -> Array:
        """States x_d (4, N + 1) at 0, dt, ..., T: the plant integrated with Runge-Kutta steps of ``dt``.

        Raises:
            ValueError: an element is no whole number of steps.
        """
        multiple("element", self.horizon / len(self.u), "dt", dt)
        return _trajectory(self, float(dt)).copy()

    def to_json(self) -> str:
        """Text that :meth:`from_json` reads back to the same numbers."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Reference:
        """The reference that :meth:`to_json` wrote."""
        return cls.of(json.loads(text))

    @classmethod
    def of(cls, reference: Reference | Mapping[str, Any]) -> Reference:
        """A reference from a reference or a mapping of its fields.

        Raises:
            ValueError: a field is unknown, missing or of a wrong shape.
        """
        if isinstance(reference, Reference):
            return reference
        known = [f.name for f in fields(cls)]
        for name in reference:
            if name not in known:
                raise ValueError(unknown("field of a reference", name, known))
        if missing := [name for name in known if name not in reference]:
            raise ValueError(f"reference lacks {', '.join(missing)}")
        return cls(**reference)


def shipped() -> Reference:
    """The reference of the tracking tables, as computed by ``agents/reference.py``; no solver is needed."""
    return Reference.from_json(resources.files(__package__).joinpath("article", "reference.json").read_text())


def minimum_energy(
    x0: ArrayLike,
    xT: ArrayLike = (0.0, 0.0, 0.0, 0.0),
    horizon: float = 8.0,
    force_limit: float = 26.0,
    elements: int = 160,
    model: CartPendulum | None = None,
    refine: int = 1,
) -> Reference:
    """Minimise the time integral of the energy (53) subject to (3)-(6), the two states and ``|F| <= force_limit``.

    (53) has no cost of control, so the force must be bounded.

    Args:
        x0: initial state, shape (4,).
        xT: final state, shape (4,).
        horizon: T in s.
        force_limit: in N.
        elements: intervals of equal length, each with a constant force.
        model: plant (Table 2 by default).
        refine: divide the finite elements, which are at most 50 ms long, by this much more.

    Raises:
        ValueError: an argument is not allowed.
        ReferenceNotFound: no trajectory joins the states within the bounds, or IPOPT gave up; with its reason.
        ImportError: CasADi is missing.
    """
    start, end = array("x0", x0, (4,)), array("xT", xT, (4,))
    T = number("horizon", horizon, above=0.0)
    bound = number("force_limit", force_limit, above=0.0)
    plant = CartPendulum.of(model, name="model")
    elements, refine = whole("elements", elements, 1), whole("refine", refine, 1)
    try:
        import casadi
    except ImportError:
        raise ImportError('minimum_energy needs CasADi: pip install "smo_gym[reference]"') from None
    parameters: list[float] = plant.as_array().tolist()

    mechanical_energy: Any = plain(energy)  # of symbols here

    def rates(x: Any, u: Any) -> Any:
        f_h, f_theta, g_h, g_theta = plain(control_affine)(casadi.sin(x[1]), casadi.cos(x[1]), x[3], *parameters)
        return casadi.vertcat(x[2], x[3], f_h + g_h * u, f_theta + g_theta * u)

    points = casadi.collocation_points(_DEGREE, "radau")
    C, _, B = casadi.collocation_coeff(points)
    parts = refine * math.ceil(T / elements / _LONGEST)
    n = elements * parts
    h = T / n
    problem = casadi.Opti()
    u = problem.variable(elements)
    x = problem.variable(4, n * _DEGREE + 1)  # the last point of a finite element is the first of the next
    cost = 0
    for k in range(n):
        inside = x[:, k * _DEGREE : (k + 1) * _DEGREE + 1]
        slopes = casadi.mtimes(inside, C)
        for j in range(_DEGREE):
            state = inside[:, j + 1]
            problem.subject_to(slopes[:, j] == h * rates(state, u[k // parts]))
            cost += h * B[j] * mechanical_energy(casadi.cos(state[1]), state[2], state[3], *parameters)
    problem.minimize(cost)
    problem.subject_to(x[:, 0] == start)
    problem.subject_to(x[:, -1] == end)
    problem.subject_to(problem.bounded(-bound, u, bound))
    problem.set_initial(x, start[:, None] + np.linspace(0.0, 1.0, n * _DEGREE + 1) * (end - start)[:, None])
    quiet: Any = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 1000}}
    problem.solver("ipopt", quiet)
    try:
        solution = problem.solve()
    except RuntimeError:
        reason = problem.return_status().replace("_", " ").lower()
        raise ReferenceNotFound(
            f"no minimum-energy trajectory from {start.tolist()} to {end.tolist()} in {T:g} s with |F| <= {bound:g} N: "
            f"IPOPT says {reason!r}"
        ) from None
    forces = np.atleast_1d(solution.value(u))
    return Reference(
        x0=tuple(start.tolist()),
        xT=tuple(end.tolist()),
        horizon=T,
        force_limit=bound,
        cost=float(solution.value(cost)),
        u=tuple(forces.tolist()),
        params=tuple(parameters),
    )


@lru_cache(maxsize=8)
def _trajectory(reference: Reference, dt: float) -> Array:
    """A reference's states (4, N + 1), kept: many environments of one table follow the same one."""
    steps = multiple("element", reference.horizon / len(reference.u), "dt", dt)
    loop = Loop(1, 1, {"plant": moving(np.array(reference.params)[:, None], dt)})
    loop.start(slice(None), np.array(reference.x0)[:, None])
    states = [loop.x[:, 0].copy()]
    for u in np.repeat(reference.u, steps):
        loop.u[:] = u
        loop.run()
        states.append(loop.x[:, 0].copy())
    return np.array(states).T
