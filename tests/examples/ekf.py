"""An extended Kalman filter in NumPy, for all slots at once: asked once a control period."""

import numpy as np

from smo_gym.evaluation.arms import Arm, register


class Kalman:
    """Settings: variances of the acceleration that the model lacks and of the encoders."""

    def __init__(self, acceleration=1.0, encoder=1e-6):
        self.acceleration, self.encoder = acceleration, encoder

    def start(self, n, dt, force, nominal):
        return Filter(self, n, dt, nominal)


class Filter:
    def __init__(self, settings, n, dt, plant):
        self.plant, self.dt = plant, dt
        self.Q = dt * np.diag([0.0, 0.0, settings.acceleration, settings.acceleration])
        self.R = settings.encoder * np.eye(2)
        self.xhat, self.P = np.zeros((4, n)), np.zeros((n, 4, 4))

    def reset(self, slots, y):
        self.xhat[:, slots] = np.concatenate([y, np.zeros_like(y)])[:, slots]
        self.P[slots] = np.eye(4)

    def update(self, samples, u):
        for y in samples:
            J, step = self._jacobian(u), self._rate(self.xhat, u)
            A = np.eye(4) + self.dt * J
            self.xhat = self.xhat + self.dt * step
            P = A @ self.P @ A.transpose(0, 2, 1) + self.Q
            K = P[:, :, :2] @ np.linalg.inv(P[:, :2, :2] + self.R)
            self.xhat = self.xhat + (K @ (y - self.xhat[:2]).T[:, :, None])[:, :, 0].T
            self.P = P - K @ P[:, :2]

    def _rate(self, x, u):
        return self.plant.drift(x) + self.plant.gain(x) * u

    def _jacobian(self, u, eps=1e-6):
        shifts = [np.zeros((4, 1)) for _ in range(4)]
        for i, shift in enumerate(shifts):
            shift[i] = eps
        rates = [self._rate(self.xhat + shift, u) - self._rate(self.xhat - shift, u) for shift in shifts]
        return np.array(rates).transpose(2, 1, 0) / (2.0 * eps)


register(Arm("ekf", "extended Kalman filter", "#555555", "#AAAAAA", lambda own, scenario, task: Kalman()))
