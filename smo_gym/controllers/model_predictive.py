"""Linear-quadratic model predictive control: the law that knows the force's limit, as a bound for those that do not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..typing import Array, Flags
from ..validation import number, whole
from .feedback import nominal, told, weights
from .lqr import LQR


class ModelPredictive:
    """The first force of the best plan over the next N control periods, on the linearised model, within the limits.

    ::

        min  sum over k < N of (e_k' Q e_k + R u_k^2) dt  +  e_N' P e_N
             where e_{k+1} = A_d e_k + B_d u_k and |u_k| <= limit

    P is the cost of the sampled plant's LQR from there on, so that without limits the plan is LQR's, -K e. OSQP solves
    it, beginning with the plan before. A plan that does not exist, which a track's limit can ask for, is replaced by
    LQR's force within the limit, and counted.

    Attributes:
        fallbacks: how many forces were LQR's since the law was made.

    Args:
        Q: weights, the diagonal (4,) or a symmetric positive semidefinite (4, 4).
        R: weight of the force.
        dt: control period in s.
        limit: of the force in N.
        horizon: N.
        model: nominal plant, or an environment, whose nominal plant is taken (Table 2 by default).
        track: largest ``|h|`` of the plan in m; None for none.

    Raises:
        ValueError: a value is not allowed.
        ImportError: the package osqp is missing.
    """

    def __init__(
        self,
        Q: ArrayLike,
        R: float,
        dt: float,
        limit: float,
        horizon: int = 50,
        model: Any = None,
        track: float | None = None,
    ) -> None:
        try:
            import osqp
        except ImportError:
            raise ImportError('model predictive control needs OSQP: pip install "smo_gym[mpc]"') from None
        from scipy import linalg, signal, sparse

        self._osqp = osqp
        self.limit, self.N = number("limit", limit, above=0.0), whole("horizon", horizon, 1)
        self.dt = number("dt", dt, above=0.0)
        self.track = None if track is None else number("track", track, above=0.0)
        weight, r = weights(Q, R)
        plant = nominal(model)
        LQR.design(weight, r, plant)  # raises for weights that leave a motion free
        A, B, *_ = signal.cont2discrete((*plant.linearise(), np.eye(4), np.zeros((4, 1))), self.dt)
        P = linalg.solve_discrete_are(A, B, weight * self.dt, np.array([[r * self.dt]]))
        self.K = (B.T @ P @ A / (r * self.dt + B.T @ P @ B))[0]
        powers = [np.linalg.matrix_power(A, k) for k in range(self.N + 1)]
        free = np.vstack(powers[1:])  # (4 N, 4): where the errors go without force
        forced = np.zeros((4 * self.N, self.N))
        for k in range(self.N):
            for j in range(k + 1):
                forced[4 * k : 4 * k + 4, j] = (powers[k - j] @ B)[:, 0]
        cost = linalg.block_diag(*[weight * self.dt] * (self.N - 1), P)
        self._curvature = sparse.csc_matrix(np.triu(2.0 * (forced.T @ cost @ forced + r * self.dt * np.eye(self.N))))
        self._slope = 2.0 * forced.T @ cost @ free
        rows = [np.eye(self.N)] if self.track is None else [np.eye(self.N), forced[::4]]
        self._rows, self._free_h = sparse.csc_matrix(np.vstack(rows)), free[::4]
        self._solvers: list[Any] = []
        self.fallbacks = 0

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N: arguments and errors as of :meth:`~smo_gym.controllers.feedback.Feedback.predict`."""
        xhat, x_d = told(observation)
        e = np.atleast_2d(xhat - x_d)
        while len(self._solvers) < len(e):
            self._solvers.append(self._solver())
        u = np.array([[self._force(solver, each)] for solver, each in zip(self._solvers, e, strict=False)])
        return (u if xhat.ndim == 2 else u[0]), state

    def _solver(self) -> Any:
        solver = self._osqp.OSQP()
        low, high = self._bounds(np.zeros(4))
        solver.setup(
            self._curvature, np.zeros(self.N), self._rows, low, high, verbose=False, eps_abs=1e-6, eps_rel=1e-6
        )
        return solver

    def _bounds(self, e: Array) -> tuple[Array, Array]:
        force = np.full(self.N, self.limit)
        if self.track is None:
            return -force, force
        drift = self._free_h @ e
        return np.concatenate([-force, -self.track - drift]), np.concatenate([force, self.track - drift])

    def _force(self, solver: Any, e: Array) -> float:
        least = float(np.clip(-self.K @ e, -self.limit, self.limit))
        if not np.isfinite(e).all():
            return float("nan")
        low, high = self._bounds(e)
        solver.update(q=self._slope @ e, l=low, u=high)
        plan = solver.solve(raise_error=False)
        if plan.info.status_val not in (1, 2):  # solved, or nearly
            self.fallbacks += 1
            solver.warm_start(x=np.zeros(self.N))
            return least
        return float(np.clip(plan.x[0], -self.limit, self.limit))

    def __repr__(self) -> str:
        return f"ModelPredictive(K={self.K.tolist()}, dt={self.dt:g}, limit={self.limit:g}, horizon={self.N})"
