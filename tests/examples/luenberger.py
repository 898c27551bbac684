"""A Luenberger observer as a block: it runs inside of the compiled loop."""

import numpy as np

from smo_gym.evaluation.arms import Arm, register
from smo_gym.kernels.batch import LANES
from smo_gym.kernels.blocks import XHAT, U, Y, at, block, four, offsets, put_four, two
from smo_gym.kernels.cart_pendulum import drift_and_gain
from smo_gym.loop import Part, columns
from smo_gym.observers.estimator import Compiling

MODEL, GAINS, DT, _ = offsets(4, 2, 1)


@block
def _estimate(signals, own, lanes):
    dt = own[DT * LANES]
    for i in range(lanes):
        (h, theta), (h_hat, theta_hat, v, omega) = two(signals, Y, i), four(signals, XHAT, i)
        M_c, m, l, g = four(own, MODEL, i)
        near, fast = two(own, GAINS, i)
        f_h, f_theta, g_h, g_theta = drift_and_gain(theta_hat, omega, M_c, m, l, g)
        u, e_h, e_theta = at(signals, U, i), h - h_hat, theta - theta_hat
        new = (
            h_hat + dt * (v + near * e_h),
            theta_hat + dt * (omega + near * e_theta),
            v + dt * (f_h + g_h * u + fast * e_h),
            omega + dt * (f_theta + g_theta * u + fast * e_theta),
        )
        put_four(signals, XHAT, i, new)


class Luenberger(Compiling):
    """A copy of the nominal plant, both error poles at -``rate`` 1/s."""

    def __init__(self, rate=40.0):
        self.rate = rate

    def part(self, n, dt, force, nominal):
        gains = (2.0 * self.rate, self.rate**2)
        return Part(columns(n, nominal.as_array(), gains, dt), sample=_estimate, xhat=np.zeros((4, n)))


register(Arm("luenberger", "Luenberger observer", "#7A5C00", "#D9B84A", lambda own, scenario, task: Luenberger()))
