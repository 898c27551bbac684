"""The article's sliding mode control with a periodic switching function, equations (49)-(50)."""

import numpy as np
from numpy.typing import ArrayLike

from ..article import SMC_GAINS
from ..kernels import inlined
from ..kernels.blocks import XHAT, U, at, block, error, four, offsets, put
from ..kernels.cart_pendulum import plant
from ..kernels.elementary import rounded, sincos, tanh, within
from ..loop import Part, columns
from ..plant import CartPendulum
from ..typing import Array, State
from ..validation import array, choice, number, shape_of, short, switch
from .feedback import Feedback, nominal

INTEGRAL, GAINS, SLOPE, AMPLITUDE, LAM, EPSILON, PERIOD, WRAP, MODEL, _ = offsets(1, 4, 1, 1, 1, 1, 1, 1, 4)
_PI = 3.141592653589793
SCHEMES = ("explicit", "implicit")


@inlined
def _surface(own: Array, i: int, e: State) -> tuple[float, float, float]:
    """S of (50) and its two parts, k1 h + k3 h' and k2 theta + k4 theta'."""
    k = four(own, GAINS, i)
    cart, rod = k[0] * e[0] + k[2] * e[2], k[1] * e[1] + k[3] * e[3]
    return 0.5 * cart * cart + 0.5 * rod * rod, cart, rod


@block
def _explicit(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        integral = at(own, INTEGRAL, i)
        s, _, _ = _surface(own, i, error(signals, i, at(own, WRAP, i)))
        sin, _ = sincos(_PI / at(own, EPSILON, i) * (s + at(own, LAM, i) * integral))
        put(signals, U, i, at(own, AMPLITUDE, i) * tanh(at(own, SLOPE, i) * sin))
        put(own, INTEGRAL, i, integral + at(own, PERIOD, i) * tanh(s))


@block
def _implicit(signals: Array, own: Array, lanes: int) -> None:
    for i in range(lanes):
        k, h, most, epsilon = four(own, GAINS, i), at(own, PERIOD, i), at(own, AMPLITUDE, i), at(own, EPSILON, i)
        x, model = four(signals, XHAT, i), four(own, MODEL, i)
        s, cart, rod = _surface(own, i, error(signals, i, at(own, WRAP, i)))
        integral = at(own, INTEGRAL, i) + h * tanh(s)
        d0, d1 = plant(x, 0.0, (0.0, *model)), plant(x, 0.0, (1.0, *model))
        rest = cart * (k[0] * d0[0] + k[2] * d0[2]) + rod * (k[1] * d0[1] + k[3] * d0[3])
        gain = cart * k[2] * (d1[2] - d0[2]) + rod * k[3] * (d1[3] - d0[3])
        ahead = s + h * rest + at(own, LAM, i) * integral
        # multiples of epsilon that attract: the even ones where the force lowers s, else the odd ones
        odd = 1.0 if gain > 0.0 else 0.0
        away = ahead - epsilon * (2.0 * rounded(0.5 * (ahead / epsilon - odd)) + odd)
        needed = h * abs(gain) * most
        share = 0.0 if needed == 0.0 else within(away / needed, -1.0, 1.0)
        put(signals, U, i, -most * share if gain > 0.0 else most * share)
        put(own, INTEGRAL, i, integral)


class SlidingModeController(Feedback):
    """Sliding mode control of the estimated state, held over each control period.

    ::

        s = (k1 h + k3 h')^2 / 2 + (k2 theta + k4 theta')^2 / 2                  (50)
        u = Z0 S(sin(pi / epsilon (s + lam integral of tanh(s))))                (49)

    on the estimate xhat, or on xhat - x_d where there is a reference to track (section 6.2).

    S is tanh with a slope (Remark 7). The integral is the law's state: it grows by ``dt tanh(s_k)`` after u_k is taken.

    ``scheme="implicit"`` takes the exact sgn at the period's end instead, on the model. With a = ds/dt without force,
    b = ds/du a second and sigma = s + dt a + lam I it is ``u = -Z0 sgn(b) sat((sigma - n epsilon) / (dt |b| Z0))``,
    where n epsilon is the nearest multiple that attracts: of even n where b < 0, of odd n where b > 0.

    Args:
        k: (k1, k2, k3, k4), positive, shape (4,); or (n, 4), one a slot. Not printed in the article.
        dt: control period in s.
        slope: of the tanh that stands for sgn; ``math.inf`` for exact sgn; or (n,). Not printed in the article.
        Z0: amplitude in N (Table 6).
        lam: weight of the integral (Table 6).
        epsilon: period of the switching function (Table 6).
        wrap: take the error of the angle within half a turn; the article's scenarios do without.
        scheme: "explicit" as in the article, or "implicit", which has no use for the slope.
        model: of the plant, for the implicit scheme; Table 2's by default.

    Raises:
        ValueError: a gain is not positive or has a wrong shape, or the scheme is another one.
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
        scheme: str = "explicit",
        model: CartPendulum | None = None,
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
        self.scheme, self.model = choice("scheme", scheme, SCHEMES), nominal(model)
        for gains in (self.k, self.slope):
            gains.flags.writeable = False

    @property
    def memory(self) -> int:
        """The integral."""
        return 1

    def part(self, n: int) -> Part:
        """What the law puts into a loop of n slots.

        Raises:
            ValueError: k has another number of slots.
        """
        k, slope = np.atleast_2d(self.k), np.atleast_1d(np.minimum(self.slope, 1e300))  # as good as sgn
        if len(k) not in (1, n):
            raise ValueError(f"k has {len(k)} slots, the observation has {n}")
        settings = (self.Z0, self.lam, self.epsilon, self.dt, float(self.wrap), self.model.as_array())
        return Part(
            columns(n, 0.0, k.T, slope[None], *settings), act=_explicit if self.scheme == "explicit" else _implicit
        )

    def __repr__(self) -> str:
        settings = {name: getattr(self, name) for name in ("dt", "slope", "Z0", "lam", "epsilon")}
        return f"SlidingModeController(k={self.k.tolist()}, {', '.join(f'{k}={v}' for k, v in settings.items())})"
