"""The article's sliding mode observer, equations (26)-(35)."""

from __future__ import annotations

import math
import numbers
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..kernels import inlined
from ..kernels.batch import LANES
from ..kernels.blocks import XHAT, Y0, Block, U, Y, at, four, offsets, put_four, put_two, two
from ..kernels.elementary import tanh
from ..kernels.modelling import Params, Rhs, for_each_model
from ..kernels.rk4 import rk4
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array, State
from ..validation import array, choice, multiple, number, shape_of, short, switch
from .estimator import Compiling
from .gains import Gains

# tanh(k e) with a slope this steep is sgn(e) for every e that is not 0, and 0 for e = 0.
_EXACT = 1e300
# RK4 is stable for x' = -r x up to r dt = 2.785 (the real root of 1 + z/2 + z^2/6 + z^3/24).
_RK4_LIMIT = 2.785
# One step more than this share of a period that is not a multiple of the step.
_SLACK = 1e-6

INJECTIONS = ("34", "26")
SCHEMES = ("rk4", "implicit")
MEASUREMENTS = ("line", "new", "old")
MEASURED = "measured"
Slope = float | tuple[float, float]
Schedule = Callable[[float, float, float, float], State]


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
    between y_{k-1} and y_k, so xhat_k knows y_k and all forces before it. On the line means that the work is done
    after y_k has come: an observer that integrates while time passes has only y_{k-1}, the ``"old"`` measurement.

    With the ``"implicit"`` scheme S is the set-valued sgn and each step solves for its end, as in Acary and Brogliato
    (Systems & Control Letters 59, 2010), with the drift of its beginning::

        sigma   = clip((X1 - Xhat1) / (h m1), -1, 1),             Xhat1+ = Xhat1 + h m1 sigma,   psi2 = m1 sigma
        rho     = clip((psi2 - Xhat2 - h f) / (h m2), -1, 1),     Xhat2+ = Xhat2 + h (f + m2 rho)

    so that neither slopes nor a low-pass are needed: in sliding sigma is the equivalent value itself.

    Args:
        gains: a :class:`Gains`, "lqr" or "smc" for a column of Table 3, or a mapping.
        compensation: False sets beta_2 = 0 (Remark 3).
        slopes: (k_p, k_v) of tanh in 1/m (1/rad) and s/m (s/rad), each a number or one a position; ``math.inf`` for
            exact sgn. The article prints no slopes; the default is chosen, near what its LQR tables identify.
        time_constant: of the low-pass for the equivalent value in s; 0 for none.
        step: integration step in s, which divides the sampling period; None for the sampling period itself.
        xhat0: initial estimate, shape (4,); "measured" for [y(0), 0, 0].
        model: nominal plant; None for the one that the environment draws its plants around.
        injection: "34", or "26" for Xhat1' = Xhat2 + m1 S(X1 - Xhat1) as (26) has it; (33) and (40) are of "34".
        scheme: "rk4" or "implicit".
        measurement: X1 within a period: on the "line" between its two samples, held at the "new" or at the "old" one.
        schedule: factors of (m1_h, m1_theta, m2_h, m2_theta) as an inlined function of xhat, of four numbers (Remark
            1); None for constant gains.

    Raises:
        ValueError: a value is not allowed, or k_p is infinite without a time constant.
    """

    gains: Gains | str | Mapping[str, ArrayLike] = "lqr"
    compensation: bool = True
    slopes: tuple[Slope, Slope] = (12.0, 12.0)
    time_constant: float = 0.0
    step: float | None = None
    xhat0: tuple[float, float, float, float] | str = (0.0, 0.0, 0.0, 0.0)
    model: Model | CartPendulum | None = None
    injection: str = "34"
    scheme: str = "rk4"
    measurement: str = "line"
    schedule: Schedule | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", Gains.of(self.gains))
        if self.model is not None and not isinstance(self.model, Model):
            object.__setattr__(self, "model", CartPendulum.of(self.model, name="model"))
        if self.xhat0 != MEASURED:
            object.__setattr__(self, "xhat0", tuple(array("xhat0", self.xhat0, (4,)).tolist()))
        object.__setattr__(self, "compensation", switch("compensation", self.compensation))
        object.__setattr__(self, "slopes", _slopes(self.slopes))
        object.__setattr__(self, "time_constant", number("time_constant", self.time_constant))
        for name, known in (("injection", INJECTIONS), ("scheme", SCHEMES), ("measurement", MEASUREMENTS)):
            choice(name, getattr(self, name), known)
        if self.time_constant < 0.0:
            raise ValueError(f"time_constant={self.time_constant!r} must be at least 0")
        if self.time_constant == 0.0 and self.scheme == "rk4" and np.isinf(self._k[0]).any():
            raise ValueError(
                "slopes[0]=inf (exact sgn) makes the injection bang-bang: psi2 needs a time_constant greater than 0, or "
                "scheme='implicit'"
            )
        if self.step is not None:
            object.__setattr__(self, "step", number("step", self.step, above=0.0))

    def largest_step(self, force: float) -> float:
        """The largest step in s at which RK4 is stable inside both boundary layers while ``|u| <= force``.

        Inside its layer tanh(k e) is k e, so the errors decay at the rates m1 k_p and (beta_1 + beta_2 |u|) k_v; RK4
        wants rate times step below 2.785. An exact sgn has no layer and no such limit: there the step sets the chatter.
        """
        if self.scheme == "implicit":
            return math.inf
        gains = self._gains
        m1 = np.array(gains.m1)
        m2 = np.array(gains.beta_1) + self.compensation * np.array(gains.beta_2) * force
        rates = [m * k for m, k in zip((m1, m2), self._k, strict=True)]
        fastest = max((float(r) for rate in rates for r in rate if math.isfinite(r)), default=0.0)
        return _RK4_LIMIT / fastest if fastest > 0.0 else math.inf

    def as_dict(self) -> dict[str, Any]:
        """The settings by name, of plain types, as the constructor takes them."""
        return asdict(self)

    def part(self, n: int, dt: float, force: float, nominal: Model | CartPendulum) -> Part:
        """What the observer puts into a loop of n slots.

        Raises:
            ValueError: the step does not divide ``dt`` or is too large for the gains (with the largest that works).
        """
        steps = self._steps(dt, force)
        model = Model.of(self.model or nominal)
        return Part(
            columns(n, dt, dt / steps, 0.0, 0.0, self._column(dt / steps), model.params),
            sample=self._block(model),
            xhat=None if isinstance(self.xhat0, str) else columns(n, np.array(self.xhat0)),
            alike=(dt, dt / steps),
            period=PERIOD,
        )

    def _block(self, model: Model) -> Block:
        full = self.injection == "26"
        if self.scheme == "implicit":
            return _implicit(model.rhs, len(model.params), full, self.schedule)
        return _explicit(model.rhs, len(model.params), full, self.measurement, self.schedule)

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
        """One slot's m1 (2), beta_1 (2), beta_2 (2), slopes (4) and the low-pass' share of new input a step, (11,)."""
        gains = self._gains
        beta_2 = gains.beta_2 if self.compensation else (0.0, 0.0)
        alpha = -math.expm1(-step / self.time_constant) if self.time_constant else 0.0
        return np.array([*gains.m1, *gains.beta_1, *beta_2, *np.minimum(self._k, _EXACT).ravel(), alpha])

    @property
    def _k(self) -> Array:
        """Slopes (k_p, k_v), one a position, (2, 2)."""
        return np.array([np.broadcast_to(k, 2) for k in self.slopes])

    @property
    def _gains(self) -> Gains:
        assert isinstance(self.gains, Gains)
        return self.gains


def _is_slope(k: Any) -> bool:
    return isinstance(k, numbers.Real) and bool(k == math.inf or 0.0 < k <= sys.float_info.max)  # type: ignore[operator]


def _slopes(slopes: Any) -> tuple[Slope, Slope]:
    if shape_of(slopes) == (2,) and all(map(_is_slope, slopes)):
        return float(slopes[0]), float(slopes[1])
    try:
        pairs = [tuple(map(float, k)) if shape_of(k) == (2,) and all(map(_is_slope, k)) else float(k) for k in slopes]
        if len(pairs) == 2 and all(isinstance(k, tuple) or _is_slope(k) for k in pairs):
            return pairs[0], pairs[1]  # type: ignore[return-value]
    except (TypeError, ValueError):
        pass
    raise ValueError(f"slopes={short(slopes)} must be two positive numbers (math.inf for the exact sgn), or two pairs")


PERIOD, STEP, PSI, M1, BETA_1, BETA_2, SLOPES, ALPHA, MODEL = offsets(1, 1, 2, 2, 2, 2, 4, 1)


@inlined
def _unscheduled(h: float, theta: float, v: float, omega: float) -> State:
    return 1.0, 1.0, 1.0, 1.0


@for_each_model
def _explicit(rhs: Rhs, params: Params, full: bool, measurement: str, schedule: Schedule | None) -> Block:
    """RK4 steps of (34)-(35), the low-pass of psi2 beside them."""
    line, new_one = measurement == "line", measurement == "new"
    factors, constant = schedule or _unscheduled, schedule is None

    @inlined
    def derivative(xhat: State, s: float, inputs: Any) -> State:
        h, theta, v, omega = xhat
        (h0, theta0, h1, theta1), (m1_h, m1_theta, m2_h, m2_theta), (kp_h, kp_theta, kv_h, kv_theta), low, model = (
            inputs
        )
        held, psi_h, psi_theta = low
        if not constant:
            a, b, c, d = factors(h, theta, v, omega)
            m1_h, m1_theta, m2_h, m2_theta = a * m1_h, b * m1_theta, c * m2_h, d * m2_theta
        h_dot = m1_h * tanh(kp_h * (h0 + s * (h1 - h0) - h))
        theta_dot = m1_theta * tanh(kp_theta * (theta0 + s * (theta1 - theta0) - theta))
        psi_h = psi_h if held > 0.0 else h_dot
        psi_theta = psi_theta if held > 0.0 else theta_dot
        _, _, a_h, a_theta = rhs(xhat, s, model)
        v_dot = m2_h * tanh(kv_h * (psi_h - v)) + a_h
        omega_dot = m2_theta * tanh(kv_theta * (psi_theta - omega)) + a_theta
        if full:
            h_dot, theta_dot = h_dot + v, theta_dot + omega
        return h_dot, theta_dot, v_dot, omega_dot

    def estimate(signals: Array, own: Array, lanes: int) -> None:
        period, step = own[PERIOD * LANES], own[STEP * LANES]
        steps = int(math.ceil(period / step - _SLACK))
        step = period / steps
        for j in range(steps):
            a, b = j / steps, (j + 1) / steps
            for i in range(lanes):
                (h0, theta0), (h1, theta1), u = two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
                m1, beta_1, beta_2, k = two(own, M1, i), two(own, BETA_1, i), two(own, BETA_2, i), four(own, SLOPES, i)
                m2 = beta_1[0] + beta_2[0] * abs(u), beta_1[1] + beta_2[1] * abs(u)
                alpha, psi, xhat = at(own, ALPHA, i), two(own, PSI, i), four(signals, XHAT, i)
                if line:
                    dh, dtheta = h1 - h0, theta1 - theta0
                    y = h0 + a * dh, theta0 + a * dtheta, h0 + b * dh, theta0 + b * dtheta
                elif new_one:
                    y = h1, theta1, h1, theta1
                else:
                    y = h0, theta0, h0, theta0
                model = (u,) + params(own, MODEL, i)  # noqa: RUF005  # Numba unpacks no tuple here
                new = rk4(derivative, xhat, (y, (*m1, *m2), k, (alpha, *psi), model), step)
                # the low-pass sees the mean injection over the step
                mean = (new[0] - xhat[0]) / step, (new[1] - xhat[1]) / step
                if full:
                    mean = mean[0] - xhat[2], mean[1] - xhat[3]
                put_two(own, PSI, i, (psi[0] + alpha * (mean[0] - psi[0]), psi[1] + alpha * (mean[1] - psi[1])))
                put_four(signals, XHAT, i, new)

    return estimate


@inlined
def _clipped(x: float) -> float:
    return min(max(x, -1.0), 1.0)


@for_each_model
def _implicit(rhs: Rhs, params: Params, full: bool, schedule: Schedule | None) -> Block:
    """Steps that solve for the set-valued sgn at their end."""
    factors = schedule or _unscheduled

    def estimate(signals: Array, own: Array, lanes: int) -> None:
        period, step = own[PERIOD * LANES], own[STEP * LANES]
        steps = int(math.ceil(period / step - _SLACK))
        step = period / steps
        for j in range(steps):
            b = (j + 1) / steps
            for i in range(lanes):
                (h0, theta0), (h1, theta1), u = two(signals, Y0, i), two(signals, Y, i), at(signals, U, i)
                m1, beta_1, beta_2, xhat = (
                    two(own, M1, i),
                    two(own, BETA_1, i),
                    two(own, BETA_2, i),
                    four(signals, XHAT, i),
                )
                f = factors(*xhat)
                m1 = f[0] * m1[0], f[1] * m1[1]
                m2 = f[2] * (beta_1[0] + beta_2[0] * abs(u)), f[3] * (beta_1[1] + beta_2[1] * abs(u))
                _, _, a_h, a_theta = rhs(xhat, 0.0, (u,) + params(own, MODEL, i))  # noqa: RUF005
                h, theta, v, omega = xhat
                if full:
                    h, theta = h + step * v, theta + step * omega
                psi_h = m1[0] * _clipped((h0 + b * (h1 - h0) - h) / (step * m1[0]))
                psi_theta = m1[1] * _clipped((theta0 + b * (theta1 - theta0) - theta) / (step * m1[1]))
                v, omega = v + step * a_h, omega + step * a_theta
                v += step * m2[0] * _clipped((psi_h - v) / (step * m2[0])) if m2[0] > 0.0 else 0.0
                omega += step * m2[1] * _clipped((psi_theta - omega) / (step * m2[1])) if m2[1] > 0.0 else 0.0
                put_four(signals, XHAT, i, (h + step * psi_h, theta + step * psi_theta, v, omega))

    return estimate
