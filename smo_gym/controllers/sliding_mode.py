"""The article's sliding mode control with a periodic switching function, equations (49)-(50)."""

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..article import SMC_GAINS
from ..kernels.blocks import U, at, block, error, four, offsets, put
from ..kernels.elementary import sincos, tanh
from ..loop import Part, columns
from ..typing import Array
from ..validation import array, number, shape_of, short, switch
from .feedback import Feedback

INTEGRAL, GAINS, SLOPE, AMPLITUDE, LAM, PI_OVER_EPSILON, PERIOD, WRAP, _ = offsets(1, 4, 1, 1, 1, 1, 1, 1)


@block
def _act(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        k, integral = four(own, GAINS, i), at(own, INTEGRAL, i)
        h, theta, v, omega = error(signals, i, at(own, WRAP, i))
        cart = k[0] * h + k[2] * v
        rod = k[1] * theta + k[3] * omega
        s = 0.5 * cart * cart + 0.5 * rod * rod
        sin, _ = sincos(at(own, PI_OVER_EPSILON, i) * (s + at(own, LAM, i) * integral))
        put(signals, U, i, at(own, AMPLITUDE, i) * tanh(at(own, SLOPE, i) * sin))
        put(own, INTEGRAL, i, integral + at(own, PERIOD, i) * tanh(s))


class SlidingModeController(Feedback):
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

    memory: ClassVar[int] = 1

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
        for gains in (self.k, self.slope):
            gains.flags.writeable = False

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots.

        Raises:
            ValueError: k has another number of slots.
        """
        k, slope = np.atleast_2d(self.k), np.atleast_1d(np.minimum(self.slope, 1e300))  # as good as sgn
        if len(k) not in (1, n):
            raise ValueError(f"k has {len(k)} slots, the observation has {n}")
        settings = (self.Z0, self.lam, math.pi / self.epsilon, self.dt, float(self.wrap))
        return Part(columns(n, 0.0, k.T, slope[None], *settings), act=_act)

    def __repr__(self) -> str:
        settings = {name: getattr(self, name) for name in ("dt", "slope", "Z0", "lam", "epsilon")}
        return f"SlidingModeController(k={self.k.tolist()}, {', '.join(f'{k}={v}' for k, v in settings.items())})"
