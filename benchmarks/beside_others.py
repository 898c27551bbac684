"""Our observers beside those of other packages: the same plant, the same noisy samples, the same processor.

    pip install opensmc filterpy do-mpc pynumdiff
    python benchmarks/beside_others.py

One run of the nominal cart pendulum from Table 4's start under LQR on its true state, measured every 10 ms with noise
of 0.2 mm and 1 mrad. Everyone is told the plant, the force and the noise; Levant's differentiator the same L. PyNumDiff
sees the whole run at once, as a smoother does: it is what hindsight is worth, not a rival.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from tabulate import tabulate

from smo_gym.evaluation import scenario
from smo_gym.evaluation.open_loop import Trajectories, trajectories
from smo_gym.models import Model
from smo_gym.observers import OBSERVERS
from smo_gym.typing import Array

PERIOD, SECONDS, SETTLED = 0.01, 10.0, 2.0
NOISE, ACCELERATION = (2e-4, 1e-3), (0.2, 1.0)
"""Standard deviations of the samples in m and rad; noise that filters grant the accelerations, per root Hz: chosen."""
L = (20.0, 60.0)
"""Levant's bounds of the accelerations, m/s^2 and rad/s^2: chosen."""
HORIZON = 10
"""Samples that moving-horizon estimators look back."""
Estimates = Callable[[Trajectories], Array]


def ours(name: str, **settings: Any) -> Estimates:
    def estimates(seen: Trajectories) -> Array:
        t = seen.dt * np.arange(len(seen.x))
        return OBSERVERS[name](**settings).run(t, seen.y[:, :, 0], seen.u[:, 0], model=seen.nominal)

    return estimates


def _flow(seen: Trajectories) -> Callable[[Array, float], Array]:
    """One Runge-Kutta step in NumPy, as a user of a filtering package writes it."""
    rate, h = Model.of(seen.nominal).rate, seen.dt

    def step(x: Array, u: float) -> Array:
        a = rate(x, u)
        b = rate(x + 0.5 * h * a, u)
        c = rate(x + 0.5 * h * b, u)
        d = rate(x + h * c, u)
        return x + h / 6.0 * (a + 2.0 * (b + c) + d)

    return step


def _process_noise(h: float) -> Array:
    Q = np.zeros((4, 4))
    for c, q in enumerate(ACCELERATION):
        Q[np.ix_([c, 2 + c], [c, 2 + c])] = q**2 * np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
    return Q


def filterpy_ekf(seen: Trajectories) -> Array:
    from filterpy.kalman import ExtendedKalmanFilter

    flow = _flow(seen)
    ekf = ExtendedKalmanFilter(dim_x=4, dim_z=2)
    ekf.x, ekf.Q, ekf.R = np.r_[seen.y[0, :, 0], 0.0, 0.0], _process_noise(seen.dt), np.diag(NOISE) ** 2
    ekf.P = np.diag([NOISE[0] ** 2, NOISE[1] ** 2, 1.0, 25.0])
    found = [ekf.x.copy()]
    for y, u in zip(seen.y[1:, :, 0], seen.u[:-1, 0], strict=True):
        F = np.array([(flow(ekf.x + e, u) - flow(ekf.x - e, u)) / 2e-6 for e in 1e-6 * np.eye(4)]).T
        ekf.x, ekf.P = flow(ekf.x, u), F @ ekf.P @ F.T + ekf.Q
        ekf.update(y, lambda x: np.eye(2, 4), lambda x: x[:2])
        found.append(ekf.x.copy())
    return np.array(found)


def opensmc_levant(seen: Trajectories) -> Array:
    from opensmc.estimators.levant import LevantDifferentiator

    found = np.zeros((len(seen.x), 4))
    for c in (0, 1):
        levant = LevantDifferentiator(order=1, L=L[c], dt=seen.dt)
        levant._z[0] = seen.y[0, c, 0]
        for k, y in enumerate(seen.y[:, c, 0]):
            levant.estimate(seen.dt * k, y, 0.0)
            found[k, [c, 2 + c]] = levant.derivatives
    return found


def do_mpc_mhe(seen: Trajectories) -> Array:
    import casadi
    import do_mpc

    p = seen.nominal
    model = do_mpc.model.Model("continuous")
    _, theta, v, omega = (model.set_variable("_x", name) for name in ("h", "theta", "v", "omega"))
    u = model.set_variable("_u", "u")
    s, c = casadi.sin(theta), casadi.cos(theta)
    M_c, m, l, g = p.cart_mass, p.bob_mass, p.rod_length, p.gravity
    whole = M_c + m * s**2
    model.set_rhs("h", v)
    model.set_rhs("theta", omega)
    model.set_rhs("v", (u + m * l * omega**2 * s - m * g * s * c) / whole, process_noise=True)
    rod = ((M_c + m) * g * s - m * l * omega**2 * s * c - u * c) / (l * whole)
    model.set_rhs("omega", rod, process_noise=True)
    for name in ("h", "theta"):
        model.set_meas(f"{name}_measured", model.x[name], meas_noise=True)
    model.set_meas("u_measured", u, meas_noise=False)
    model.setup()
    mhe = do_mpc.estimator.MHE(model)
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
    mhe.set_param(n_horizon=HORIZON, t_step=seen.dt, meas_from_data=True, store_full_solution=False, nlpsol_opts=quiet)
    weights = [1.0 / (q**2 / seen.dt) for q in ACCELERATION]
    mhe.set_default_objective(
        P_x=np.diag([1.0 / NOISE[0] ** 2, 1.0 / NOISE[1] ** 2, 1.0, 1.0]),
        P_v=np.diag(1.0 / np.array(NOISE) ** 2),
        P_w=np.diag(weights),
    )
    mhe.setup()
    mhe.x0 = np.r_[seen.y[0, :, 0], 0.0, 0.0]
    mhe.set_initial_guess()
    found = [np.r_[seen.y[0, :, 0], 0.0, 0.0]]
    for y, u_k in zip(seen.y[1:, :, 0], seen.u[:-1, 0], strict=True):
        found.append(np.asarray(mhe.make_step(np.r_[y, u_k][:, None])).ravel())
    return np.array(found)


def pynumdiff_rts(seen: Trajectories) -> Array:
    from pynumdiff import rtsdiff

    found = np.zeros((len(seen.x), 4))
    for c in (0, 1):
        # the ratio of process to measurement noise with the least error here: hindsight in that, too
        tries = [rtsdiff(seen.y[:, c, 0], seen.dt, 2, ratio) for ratio in np.arange(0.0, 14.0)]
        position, speed = min(tries, key=lambda each: float(np.mean((each[1] - seen.x[:, 2 + c, 0]) ** 2)))
        found[:, c], found[:, 2 + c] = position, speed
    return found


def rows(everyone: dict[str, Estimates], seen: Trajectories) -> Iterator[tuple[object, ...]]:
    late = slice(round(SETTLED / seen.dt), None)
    for name, estimates in everyone.items():
        try:
            estimates(seen)  # compiled, imported
            began = time.perf_counter()
            found = estimates(seen)
            seconds = time.perf_counter() - began
        except ImportError as error:
            yield name, "-", "-", f"not installed: {error.name}"
            continue
        error = np.sqrt(((found - seen.x[:, :, 0])[late, 2:] ** 2).mean(0))
        yield name, *(f"{value:.4f}" for value in error), f"{1e6 * seconds / len(seen.x):.3g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    warnings.simplefilter("ignore")
    place = scenario.named("regulation")
    seen = trajectories(
        place.environment,
        place.agent("lqr"),
        np.array(place.initial_states.value[""]),
        *(0.0, 1, 0),
        control_period=PERIOD,
        horizon=SECONDS,
        force_limit=30.0,
        track_limit=None,
        sensor={"noise": NOISE},
    )
    filters = {"noise": NOISE, "acceleration": ACCELERATION}
    everyone: dict[str, Estimates] = {
        "EKF, smo_gym": ours("ekf", **filters),
        "EKF, filterpy": filterpy_ekf,
        "Levant, smo_gym": ours("levant", L=L),
        "Levant, explicit, smo_gym": ours("levant", L=L, scheme="explicit"),
        "Levant, opensmc": opensmc_levant,
        "moving horizon, smo_gym": ours("mhe", horizon=HORIZON, **filters),
        "moving horizon, do-mpc": do_mpc_mhe,
        "RTS smoother, PyNumDiff": pynumdiff_rts,
    }
    header = ("", "h', m/s", "theta', rad/s", "us a sample")
    print(tabulate([*rows(everyone, seen)], header, disable_numparse=True))


if __name__ == "__main__":
    main()
