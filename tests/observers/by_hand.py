"""The pendulum, its linearisation and a recording of it in plain NumPy, beside the compiled ones."""

import numpy as np

M_C, M, L, G = 3.5, 0.32, 0.44, -9.8
DT = 0.005


def rate(x, u):
    """X' by equations (1)-(2) as printed."""
    _, theta, v, omega = x
    sin, cos = np.sin(theta), np.cos(theta)
    h = (u - M * G * cos * sin + M * L * omega**2 * sin) / (M_C + M * sin**2)
    t = ((M_C + M) * G * sin - u * cos - M * L * omega**2 * sin * cos) / (M_C * L + M * L * sin**2)
    return np.array([v, omega, h, t])


def rk4(x, u, dt):
    a = rate(x, u)
    b = rate(x + dt / 2 * a, u)
    c = rate(x + dt / 2 * b, u)
    d = rate(x + dt * c, u)
    return x + dt / 6 * (a + 2 * b + 2 * c + d)


def jacobian(x, u):
    """By differences of complex steps, exact to rounding."""
    return np.array([rate(x + 1e-30j * e, u).imag / 1e-30 for e in np.eye(4)]).T


def process_noise(x, u, acceleration, dt):
    """Its integral over a step by Simpson's rule, which is exact for these cubics."""
    push = (rate(x, u + 1.0) - rate(x, u))[2:]
    enters = np.array([[0, 0], [0, 0], [1, 0], [push[1] / push[0], 1]])
    density = np.diag(np.square(acceleration))

    def spread(t):
        F = np.eye(4) + t * np.eye(4, k=2)
        return F @ enters @ density @ enters.T @ F.T

    return dt / 6 * (spread(0) + 4 * spread(dt / 2) + spread(dt))


def recording(n=1000, dt=DT, noise=(1e-4, 1e-3), seed=1):
    """Times, measured positions, forces and states of a swinging pendulum that is pushed about."""
    random = np.random.default_rng(seed)
    t = dt * np.arange(n)
    u = 8.0 * np.sin(2.0 * t) + random.normal(size=n)
    x = np.empty((n, 4))
    x[0] = 0.2, 2.5, 0.4, -1.0
    for k in range(n - 1):
        x[k + 1] = rk4(x[k], u[k], dt)
    return t, x[:, :2] + noise * random.normal(size=(n, 2)), u, x


def copy(t, y, u, near, fast, substeps=1):
    """A copy of the plant that is corrected in proportion to the error of its positions.

    ``near`` and ``fast`` say the gains of positions and velocities, (2, 2), for the time since the sample before.
    """
    xhat = [np.array([*y[0], 0.0, 0.0])]
    for k in range(1, len(t)):
        h, x = t[k] - t[k - 1], xhat[-1]
        steps = int(np.ceil(substeps * h / DT - 1e-6))
        for _ in range(steps):
            x = rk4(x, u[k - 1], h / steps)
        xhat.append(x + np.vstack([near(h), fast(h)]) @ (y[k] - x[:2]))
    return np.array(xhat)
