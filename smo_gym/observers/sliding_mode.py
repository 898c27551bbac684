"""The article's sliding mode observer, equations (26)-(35)."""

from __future__ import annotations

import math
import numbers
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.blocks import Block
from ..kernels.rk4 import STABLE
from ..kernels.sliding import PERIOD, Schedule, explicit, implicit
from ..loop import Part, columns
from ..models import Model
from ..plant import CartPendulum
from ..typing import Array
from ..validation import array, choice, multiple, number, shape_of, short, switch, whole
from .estimator import Compiling
from .gains import Gains

# tanh(k e) with a slope this steep is sgn(e) for every e that is not 0, and 0 for e = 0.
_EXACT = 1e300

INJECTIONS = ("34", "26")
SCHEMES = ("rk4", "implicit")
MEASUREMENTS = ("line", "new", "old")
MEASURED = "measured"
Slope = float | tuple[float, float]
Slopes = tuple[Slope, Slope]
"""(k_p, k_v), each alike for both positions or one for each."""


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
        measurement: X1 within a period, on the "line" between its samples, held at the "new" or at the "old" one.
        substeps: integration steps in a sampling period, in place of ``step``.
        schedule: factors of (m1_h, m1_theta, m2_h, m2_theta) as an inlined function of xhat's four numbers (Remark 1);
            None for constant gains.

    Raises:
        ValueError: a value is not allowed, or k_p is infinite without a time constant.
    """

    gains: Gains | str | Mapping[str, ArrayLike] = "lqr"
    compensation: bool = True
    slopes: Slopes = (12.0, 12.0)
    time_constant: float = 0.0
    step: float | None = None
    xhat0: tuple[float, float, float, float] | str = (0.0, 0.0, 0.0, 0.0)
    model: Model | CartPendulum | None = None
    injection: str = "34"
    scheme: str = "rk4"
    measurement: str = "line"
    substeps: int | None = None
    schedule: Schedule | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", Gains.of(self.gains))
        if self.model is not None and not isinstance(self.model, Model):
            object.__setattr__(self, "model", CartPendulum.of(self.model, name="model"))
        if not (isinstance(self.xhat0, str) and self.xhat0 == MEASURED):
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
                "slopes[0]=inf (exact sgn) makes the injection bang-bang: psi2 needs a time_constant greater than 0, "
                "or scheme='implicit'"
            )
        if self.step is not None:
            object.__setattr__(self, "step", number("step", self.step, above=0.0))
        if self.substeps is not None and (whole("substeps", self.substeps, 1) and self.step is not None):
            raise ValueError(f"substeps={self.substeps!r} and step={self.step!r} say the same: give one")

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
        gains_and_slopes = zip((*m1.tolist(), *m2.tolist()), self._k.ravel().tolist(), strict=True)
        fastest = max((m * k for m, k in gains_and_slopes if math.isfinite(k)), default=0.0)
        return STABLE / fastest if fastest > 0.0 else math.inf

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
            return implicit(model.rhs, len(model.params), full, self.schedule)
        return explicit(model.rhs, len(model.params), full, self.measurement, self.schedule)

    def _steps(self, dt: float, force: float) -> int:
        """How many integration steps a sampling period has."""
        step = dt / self.substeps if self.substeps else dt if self.step is None else self.step
        steps = self.substeps or multiple("sampling period", dt, "step", step)
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


def _slopes(slopes: Any) -> Slopes:
    if shape_of(slopes) == (2,) and all(map(_is_slope, slopes)):
        return float(slopes[0]), float(slopes[1])
    try:
        pairs = [tuple(map(float, k)) if shape_of(k) == (2,) and all(map(_is_slope, k)) else float(k) for k in slopes]
        if len(pairs) == 2 and all(isinstance(k, tuple) or _is_slope(k) for k in pairs):
            return pairs[0], pairs[1]  # type: ignore[return-value]
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"slopes={short(slopes)} must be two positive numbers (math.inf for the exact sgn), or two pairs")
