"""Reaching laws and the conditions on their gains."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

from ..kernels import reaching as kernels
from ..kernels.reaching import Hold, Reach
from ..validation import choice, number, switch

SIGN, LAYER, SUPER_TWISTING, PI = "sign", "layer", "super-twisting", "pi"
KINDS = (SIGN, LAYER, SUPER_TWISTING, PI)
IMPLICIT, PREDICTING, EXPLICIT = "implicit", "predicting", "explicit"
SCHEMES = (IMPLICIT, PREDICTING, EXPLICIT)
_REACHES: dict[tuple[str, str], Reach] = {
    (SIGN, IMPLICIT): kernels.sign_implicit,
    (SIGN, EXPLICIT): kernels.sign_explicit,
    (LAYER, IMPLICIT): kernels.layer,
    (SUPER_TWISTING, IMPLICIT): kernels.twisting_implicit,
    (SUPER_TWISTING, PREDICTING): kernels.twisting_predicting,
    (SUPER_TWISTING, EXPLICIT): kernels.twisting_explicit,
    (PI, IMPLICIT): kernels.proportional_integral,
}


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition of a theorem: what it says, and by how much it holds."""

    name: str
    margin: float
    """Above 0 where it holds, in units of what it bounds."""

    @property
    def holds(self) -> bool:
        """Whether it does."""
        return self.margin > 0.0


@dataclass(frozen=True, slots=True)
class Reaching:
    """``sigma' = v + d(t)``: how v brings a sliding variable to 0 against a rate d that nobody knows.

    - ``sign``, ``v = -k1 sgn sigma``: to 0 in a finite time where ``|d| < k1``;
    - ``layer``, ``v = -k1 sat(sigma / k2)``: to ``|sigma| <= k2 |d| / k1``;
    - ``super-twisting``, ``v = -k1 sqrt|sigma| sgn sigma + z, z' = -k2 sgn sigma``: to 0 in a finite time where
      ``|d'| < L``, for gains that satisfy :meth:`conditions`;
    - ``pi``, ``v = -k1 sigma + z, z' = -k2 sigma``, the linear rival: to 0 where d is constant, else to the order of
      ``|d'| / k2``.

    Explicit steps are Euler's. Implicit ones take sgn at the step's end, where the set-valued sgn is a projection, so
    that no gain makes them chatter (Brogliato, Polyakov and Efimov, The implicit discretization of the super-twisting
    sliding-mode control algorithm, IEEE Trans. Automatic Control 65, 2020). They let sigma + h v vanish, without a
    guess of d, and leave ``sigma_{k+1} = h d_k``.

    "predicting" is ours and guesses d by -z. D, the integral of d, is what sigma would be without v; super-twisting is
    Levant's differentiator of D, whose implicit step (Acary and Brogliato 2010) predicts D to the order of h^2, and v
    takes that prediction off: once it has converged ``sigma_{k+1} = h (d_k - d_{k-1})``. It is more accurate, and
    twice as steep near 0: noise of sigma moves it more.

    ``conditioned`` keeps z from running away while the actuator is at its limit: then ``z' = k2 sgn(v_acts - z)``, with
    the rate that acts (Seeber and Reichhartinger, Conditioned super-twisting algorithm for systems with saturated
    control action, Automatica 116, 2020). Of the kind ``pi`` likewise.

    Args:
        kind: one of the table.
        k1: first gain.
        k2: second gain; ``sign`` has none.
        scheme: "implicit" or "explicit"; of super-twisting also "predicting".
        conditioned: what becomes of z at the limit.
        L: bound of ``|d'|`` that super-twisting is meant for, of ``|d|`` that the others are; where the gains break a
            condition for it, that is warned of.

    Raises:
        ValueError: an unknown kind or scheme, or a gain that is not positive.
    """

    kind: str = SUPER_TWISTING
    k1: float = 1.5
    k2: float = 1.1
    scheme: str = IMPLICIT
    conditioned: bool = True
    L: float | None = None

    def __post_init__(self) -> None:
        choice("kind of reaching law", self.kind, KINDS)
        choice("scheme", self.scheme, SCHEMES)
        if (self.kind, self.scheme) not in _REACHES:
            schemes = " or ".join(repr(scheme) for kind, scheme in _REACHES if kind == self.kind)
            raise ValueError(f"scheme={self.scheme!r} of a reaching law of the kind {self.kind!r} must be {schemes}")
        for name in ("k1", "k2"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        switch("conditioned", self.conditioned)
        if self.L is not None:
            object.__setattr__(self, "L", number("L", self.L, above=0.0))
            for broken in (each for each in self.conditions(self.L) if not each.holds):
                warnings.warn(
                    f"{self.kind} with k1={self.k1:g}, k2={self.k2:g} breaks {broken.name} for L={self.L:g}, by "
                    f"{-broken.margin:.3g}: sigma need not stay at 0",
                    stacklevel=3,
                )

    @classmethod
    def super_twisting(cls, L: float, scheme: str = IMPLICIT, conditioned: bool = True) -> Reaching:
        """Super-twisting for ``|d'| < L`` with Levant's gains, k1 = 1.5 sqrt L and k2 = 1.1 L.

        Raises:
            ValueError: L is not positive.
        """
        L = number("L", L, above=0.0)
        return cls(SUPER_TWISTING, 1.5 * math.sqrt(L), 1.1 * L, scheme, conditioned, L)

    @classmethod
    def pi(cls, omega: float) -> Reaching:
        """The linear rival with a double pole at -omega, in 1/s.

        Raises:
            ValueError: omega is not positive.
        """
        omega = number("omega", omega, above=0.0)
        return cls(PI, 2.0 * omega, omega * omega)

    def conditions(self, L: float, gain: float = 1.0) -> tuple[Condition, ...]:
        """What must hold so that sigma reaches 0 and stays there, each with its margin.

        Of super-twisting b k2 > L and b k1 > sqrt(b k2 + L), which Levant's gains satisfy for b = 1 (Seeber and Horn,
        Stability proof for a well-established super-twisting parameter setting, Automatica 84, 2017).

        Args:
            L: bound of ``|d'|`` of super-twisting, of ``|d|`` of the kinds sign and layer; ``pi`` has no condition.
            gain: least b where ``sigma' = b v + d`` with a constant b; larger ones are better. A gain that changes adds
                to d a part that this does not know.
        """
        if self.kind == SUPER_TWISTING:
            k1, k2 = gain * self.k1, gain * self.k2
            return Condition("k2 > L", k2 - L), Condition("k1 > sqrt(k2 + L)", k1 - math.sqrt(k2 + L))
        return () if self.kind == PI else (Condition("k1 > |d|", gain * self.k1 - L),)

    @property
    def kernels(self) -> tuple[Reach, Hold]:
        """The compiled functions of a step, and of z at the limit."""
        if not self.conditioned or self.kind in (SIGN, LAYER):
            return _REACHES[self.kind, self.scheme], kernels.nothing_held
        return _REACHES[self.kind, self.scheme], kernels.conditioned
