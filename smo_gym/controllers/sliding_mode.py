"""The article's sliding mode control with a periodic switching function, equations (49)-(50)."""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..article import SMC_GAINS
from ..kernels import kernel
from ..kernels.elementary import sincos, tanh
from ..typing import Array, Flags
from ..validation import array, number, shape_of, short, switch
from .feedback import estimated_error


class SlidingModeController:
    """Sliding mode control of the estimated state, held over each control period.

    ::

        s = (k1 h + k3 h')^2 / 2 + (k2 theta + k4 theta')^2 / 2                  (50)
        u = Z0 S(sin(pi / epsilon (s + lam integral of tanh(s))))                (49)

    on the estimate xhat, or on xhat - x_d where there is a reference to track (section 6.2).

    S is tanh with a slope (Remark 7). The integral is the law's state: it grows by ``dt tanh(s_k)`` after u_k is taken.

    Args:
        k: (k1, k2, k3, k4), positive, shape (4,); or (n, 4), one a slot. Not printed in the article.
        dt: control period in s.
        slope: of the tanh that stands for sgn; ``math.inf`` for exact sgn; or (n,). Not printed in the article.
        Z0: amplitude in N (Table 6).
        lam: weight of the integral (Table 6).
        epsilon: period of the switching function (Table 6).
        wrap: take the error of the angle within half a turn; the article's scenarios do without.

    Raises:
        ValueError: a gain is not positive or has a wrong shape.
    """

    def __init__(
        self,
        k: ArrayLike,
        dt: float,
        slope: ArrayLike,
        Z0: float = SMC_GAINS["Z0"],
        lam: float = SMC_GAINS["lam"],
        epsilon: float = SMC_GAINS["epsilon"],
        wrap: bool = True,
    ) -> None:
        shape = shape_of(k)
        if shape is None or shape[-1:] != (4,) or len(shape) > 2:
            raise ValueError(f"k has shape {shape}, it must have shape (4,) or (n, 4)")
        self.k = array("k", k, shape)
        if (self.k <= 0.0).any():
            raise ValueError(f"k={self.k.tolist()} must be positive")
        try:
            self.slope = np.array(slope, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            self.slope = np.array(np.nan)
        if self.slope.shape not in ((), shape[:-1]) or not (self.slope > 0.0).all():
            raise ValueError(f"slope={short(slope)} must be positive, one number or one a slot")
        self.dt = number("dt", dt, above=0.0)
        self.Z0 = number("Z0", Z0, above=0.0)
        self.lam = number("lam", lam, above=0.0)
        self.epsilon = number("epsilon", epsilon, above=0.0)
        self.wrap = switch("wrap", wrap)
        rows = [self.k, np.broadcast_to(np.minimum(self.slope, 1e300)[..., None], (*shape[:-1], 1))]  # 1e300: sgn
        self._gains = np.atleast_2d(np.concatenate(rows, axis=-1))
        self._settings = np.array([self.Z0, self.lam, math.pi / self.epsilon, self.dt])

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N and the integral after it.

        Args:
            observation: (n, observation) or (observation,), from an observer wrapper.
            state: ``(integral,)`` with the integral of tanh(s), shape (n,); None at the start.
            episode_start: slots whose integral starts at 0, shape (n,).
            deterministic: without effect: the law draws nothing.

        Returns:
            The force (n, 1), or (1,) for one observation, and the state for the next call.

        Raises:
            ValueError: the observation does not come from an observer wrapper.
        """
        e = np.atleast_2d(estimated_error(observation, self.wrap))
        n = len(e)
        if len(self._gains) not in (1, n):
            raise ValueError(f"k has {len(self._gains)} slots, the observation has shape {np.shape(observation)}")
        integral = np.zeros(n) if state is None else array("state[0]", state[0], (n,))
        if shape_of(episode_start) not in ((), (n,)):
            raise ValueError(f"episode_start={short(episode_start)} must hold {n} flags, one a slot")
        if episode_start is not None:
            integral[np.broadcast_to(np.asarray(episode_start, dtype=np.bool_), n)] = 0.0
        u = np.empty((n, 1))
        _switch(e, integral, self._gains, self._settings, u)
        return (u if np.ndim(observation) == 2 else u[0]), (integral,)

    def __repr__(self) -> str:
        settings = {name: getattr(self, name) for name in ("dt", "slope", "Z0", "lam", "epsilon")}
        return f"SlidingModeController(k={self.k.tolist()}, {', '.join(f'{k}={v}' for k, v in settings.items())})"


@kernel
def _switch(e: Array, integral: Array, gains: Array, settings: Array, u: Array) -> None:
    Z0, lam, pi_over_epsilon, dt = settings
    for i in range(len(u)):
        k1, k2, k3, k4, slope = gains[min(i, len(gains) - 1)]  # one row for all slots, or one each
        h, theta, v, omega = e[i, 0], e[i, 1], e[i, 2], e[i, 3]
        cart = k1 * h + k3 * v
        rod = k2 * theta + k4 * omega
        s = 0.5 * cart * cart + 0.5 * rod * rod
        sin, _ = sincos(pi_over_epsilon * (s + lam * integral[i]))
        u[i, 0] = Z0 * tanh(slope * sin)
        integral[i] += dt * tanh(s)
