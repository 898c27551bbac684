"""The article's sliding mode observer, equations (27)-(35)."""

from __future__ import annotations

import math
import numbers
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..article import OBSERVER_GAINS
from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Y0, U, Y, at, block, four, offsets, put_four, put_two, two
from ..kernels.cart_pendulum import drift_and_gain
from ..kernels.elementary import tanh
from ..kernels.rk4 import STABLE, rk4
from ..loop import Part, columns
from ..plant import CartPendulum
from ..typing import Array
from ..validation import array, choice, mapping, multiple, number, shape_of, short, switch
from .estimator import Compiling

# tanh(k e) with a slope this steep is sgn(e) for every e that is not 0, and 0 for e = 0.
_EXACT = 1e300


@dataclass(frozen=True, slots=True)
class Gains:
    """Observer gains of equations (27)-(29), named as in Table 3.

    Args:
        m1: (m_11, m_12) in m/s and rad/s, the sliding gains of the positions.
        beta_1: (beta_{1,1}, beta_{2,1}) in m/s^2 and rad/s^2, the constant part of the sliding gains of the velocities.
        beta_2: (beta_{1,2}, beta_{2,2}) in 1/kg and 1/(kg m), their part in |u|: the compensation of the input
            uncertainty (Remark 3).

    Raises:
        ValueError: m1 is not positive, or a beta is negative.
    """

    m1: tuple[float, float]
    beta_1: tuple[float, float]
    beta_2: tuple[float, float]

    def __post_init__(self) -> None:
        for name in ("m1", "beta_1", "beta_2"):
            values = array(name, getattr(self, name), (2,))
            if (values < 0.0).any() or (name == "m1" and (values == 0.0).any()):
                raise ValueError(f"{name}={values.tolist()} must be {'positive' if name == 'm1' else 'at least 0'}")
            object.__setattr__(self, name, tuple(values.tolist()))

    @classmethod
    def of(cls, gains: str | Gains | Mapping[str, ArrayLike]) -> Gains:
        """Gains from gains, a column of Table 3 ("lqr" or "smc") or a mapping of field names.

        Raises:
            ValueError: an unknown column or field, or a value that is not allowed.
        """
        if isinstance(gains, Gains):
            return gains
        if isinstance(gains, str):
            return cls(**OBSERVER_GAINS[choice("column of Table 3", gains, OBSERVER_GAINS)])
        known = [f.name for f in fields(cls)]
        values = mapping("observer gain", gains, known)
        if missing := [name for name in known if name not in values]:
            raise ValueError(f"observer gains lack {', '.join(missing)}")
        return cls(**values)


@dataclass(frozen=True, slots=True)
class SlidingModeObserver(Compiling):
    """Estimates the state from sampled positions, the applied force, nominal parameters and gains.

    ::

        Xhat1' = m1 S(k_p (X1 - Xhat1))                                          (34)
        Xhat2' = (beta_1 + beta_2 |u|) S(k_v (psi2 - Xhat2)) + f20(xhat) + g20(xhat) u   (35), (29)
        psi2   = {Xhat1'}_eq                                                     (33)

    S is ``tanh`` (Remark 7) or, with an infinite slope, the exact sgn. With tanh the injection Xhat1' is continuous
    and is its own equivalent value. Exact sgn makes it bang-bang; the equivalent value operator is then a low-pass
    with a time constant, driven by the mean injection of each step.

    Over the sampling period that ends at sample k the observer uses u_{k-1} and the measurement on the straight line
    between y_{k-1} and y_k, so xhat_k knows y_k and all forces before it.

    Args:
        gains: a :class:`Gains`, "lqr" or "smc" for a column of Table 3, or a mapping.
        compensation: False sets beta_2 = 0 (Remark 3).
        slopes: (k_p, k_v) of tanh in 1/m (1/rad) and s/m (s/rad); ``math.inf`` for exact sgn. The article prints no
            slopes; the default is chosen, near what its LQR tables identify.
        time_constant: of the low-pass for the equivalent value in s; 0 for none.
        step: integration step in s, which divides the sampling period; None for the sampling period itself.
        xhat0: initial estimate, shape (4,).
        model: nominal plant; None for the one that the environment draws its plants around.

    Raises:
        ValueError: a value is not allowed, or k_p is infinite without a time constant.
    """

    gains: Gains | str | Mapping[str, ArrayLike] = "lqr"
    compensation: bool = True
    slopes: tuple[float, float] = (12.0, 12.0)
    time_constant: float = 0.0
    step: float | None = None
    xhat0: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    model: CartPendulum | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", Gains.of(self.gains))
        if self.model is not None:
            object.__setattr__(self, "model", CartPendulum.of(self.model, name="model"))
        object.__setattr__(self, "xhat0", tuple(array("xhat0", self.xhat0, (4,)).tolist()))
        object.__setattr__(self, "compensation", switch("compensation", self.compensation))
        if shape_of(self.slopes) != (2,) or not all(map(_is_slope, self.slopes)):
            raise ValueError(f"slopes={short(self.slopes)} must be two positive numbers (math.inf for the exact sgn)")
        object.__setattr__(self, "slopes", tuple(map(float, self.slopes)))
        object.__setattr__(self, "time_constant", number("time_constant", self.time_constant))
        if self.time_constant < 0.0:
            raise ValueError(f"time_constant={self.time_constant!r} must be at least 0")
        if self.time_constant == 0.0 and math.isinf(self.slopes[0]):
            raise ValueError(
                "slopes[0]=inf (exact sgn) makes the injection bang-bang: psi2 needs a time_constant greater than 0"
            )
        if self.step is not None:
            object.__setattr__(self, "step", number("step", self.step, above=0.0))

    def largest_step(self, force: float) -> float:
        """The largest step in s at which RK4 is stable inside both boundary layers while ``|u| <= force``.

        Inside its layer tanh(k e) is k e, so the errors decay at the rates m1 k_p and (beta_1 + beta_2 |u|) k_v; RK4
        wants rate times step below 2.785. An exact sgn has no layer and no such limit: there the step sets the chatter.
        """
        gains = self._gains
        m1 = np.array(gains.m1)
        m2 = np.array(gains.beta_1) + self.compensation * np.array(gains.beta_2) * force
        rates = [m.max() * k for m, k in zip((m1, m2), self.slopes, strict=True) if math.isfinite(k)]
        fastest = max(rates, default=0.0)
        return STABLE / fastest if fastest > 0.0 else math.inf

    def as_dict(self) -> dict[str, Any]:
        """The settings by name, of plain types, as the constructor takes them."""
        return asdict(self)

    def part(self, n: int, dt: float, force: float, nominal: CartPendulum) -> Part:
        """What the observer puts into a loop of n slots.

        Raises:
            ValueError: the step does not divide ``dt`` or is too large for the gains (with the largest that works).
        """
        steps = self._steps(dt, force)
        model = (self.model or nominal).as_array()
        return Part(
            columns(n, 0.0, 0.0, self._column(dt / steps), model, steps, dt / steps),
            sample=_estimate,
            xhat=columns(n, np.array(self.xhat0)),
            alike=(float(steps), dt / steps),
        )

    def _steps(self, dt: float, force: float) -> int:
        """How many integration steps a sampling period has."""
        step = dt if self.step is None else self.step
        steps = multiple("sampling period", dt, "step", step)
        largest = self.largest_step(force)
        if step > largest:
            raise ValueError(
                f"step={step:g} s is too large for these gains and slopes with |u| up to {force:g} N: RK4 is stable up "
                f"to {largest:.4g} s; the largest step that divides the sampling period is "
                f"step={dt / math.ceil(dt / largest)!r}"
            )
        return steps

    def _column(self, step: float) -> Array:
        """One slot's m1 (2), beta_1 (2), beta_2 (2), slopes (2) and the low-pass' share of new input a step, (9,)."""
        gains = self._gains
        beta_2 = gains.beta_2 if self.compensation else (0.0, 0.0)
        alpha = -math.expm1(-step / self.time_constant) if self.time_constant else 0.0
        return np.array([*gains.m1, *gains.beta_1, *beta_2, *(min(k, _EXACT) for k in self.slopes), alpha])

    @property
    def _gains(self) -> Gains:
        assert isinstance(self.gains, Gains)
        return self.gains


def _is_slope(k: Any) -> bool:
    return isinstance(k, numbers.Real) and bool(k == math.inf or 0.0 < k <= sys.float_info.max)  # type: ignore[operator]


PSI, M1, BETA_1, BETA_2, SLOPES, ALPHA, MODEL, STEPS, STEP, _ = offsets(2, 2, 2, 2, 2, 1, 4, 1, 1)


@inlined
def _derivative(
    xhat: tuple[float, float, float, float], s: float, inputs: tuple[float, ...]
) -> tuple[float, float, float, float]:
    """Xhat' of (34)-(35), the measurement on the line between two samples."""
    h, theta, v, omega = xhat
    (h0, theta0, h1, theta1, u, m1_h, m1_theta, m2_h, m2_theta, k_p, k_v, held, psi_h, psi_theta, M_c, m, l, g) = inputs
    h_dot = m1_h * tanh(k_p * (h0 + s * (h1 - h0) - h))
    theta_dot = m1_theta * tanh(k_p * (theta0 + s * (theta1 - theta0) - theta))
    psi_h = psi_h if held > 0.0 else h_dot
    psi_theta = psi_theta if held > 0.0 else theta_dot
    f_h, f_theta, g_h, g_theta = drift_and_gain(theta, omega, M_c, m, l, g)
    v_dot = m2_h * tanh(k_v * (psi_h - v)) + (f_h + g_h * u)
    omega_dot = m2_theta * tanh(k_v * (psi_theta - omega)) + (f_theta + g_theta * u)
    return h_dot, theta_dot, v_dot, omega_dot


@block
def _estimate(signals: Array, own: Array, lanes: int) -> None:
    steps, step = int(own[STEPS * LANES]), own[STEP * LANES]
    for j in range(steps):
        a, b = j / steps, (j + 1) / steps
        for i in range(lanes):
            (h0, theta0), (h1, theta1), u = two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
            dh, dtheta = h1 - h0, theta1 - theta0
            m1, beta_1, beta_2, k = two(own, M1, i), two(own, BETA_1, i), two(own, BETA_2, i), two(own, SLOPES, i)
            m2 = beta_1[0] + beta_2[0] * abs(u), beta_1[1] + beta_2[1] * abs(u)
            alpha, psi, model, xhat = at(own, ALPHA, i), two(own, PSI, i), four(own, MODEL, i), four(signals, XHAT, i)
            line = h0 + a * dh, theta0 + a * dtheta, h0 + b * dh, theta0 + b * dtheta
            new = rk4(_derivative, xhat, (*line, u, *m1, *m2, *k, alpha, *psi, *model), step)
            # the low-pass sees the mean injection over the step
            mean = (new[0] - xhat[0]) / step, (new[1] - xhat[1]) / step
            put_two(own, PSI, i, (psi[0] + alpha * (mean[0] - psi[0]), psi[1] + alpha * (mean[1] - psi[1])))
            put_four(signals, XHAT, i, new)
