"""A claim of the article, the number that decides it, and its verdict by a rule that stands before the number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from . import formats
from .estimates import Estimate

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"
ORDER = ("Abstract", "Contribution", "Property", "Assumption", "Theorem", "Remark", "Conclusion")
"""Of the places, by their first word."""
HEADER = ("claim", "place", "verdict", "number", "interval", "command")


@dataclass(frozen=True, slots=True)
class Rule:
    """When a claim holds: its number, with all of the interval, is above a bound, or below one."""

    kind: str
    """"above" or "below"."""
    bound: float

    def verdict(self, found: Estimate) -> str:
        """What an estimate says."""
        if math.isnan(found.number):
            return UNDECIDED
        low, high = found.bounds
        if self.kind == "below":
            low, high = -high, -low
        bound = self.bound if self.kind == "above" else -self.bound
        return HOLDS if low > bound else FAILS if high <= bound else UNDECIDED

    @property
    def said(self) -> str:
        """The rule in words."""
        return "finite" if math.isinf(self.bound) else f"{self.kind} {self.bound:g}"


@dataclass(frozen=True, slots=True)
class Printed:
    """When a printed number holds: it lies in the interval, or at the number where there is none, up to a tolerance.

    Where as many settings were fitted to it as there are numbers, agreement decides nothing.
    """

    value: float
    tolerance: float = 0.0
    fitted: bool = False

    def verdict(self, found: Estimate) -> str:
        """What an estimate says."""
        low, high = found.bounds
        if math.isnan(low):
            return UNDECIDED
        if not low - self.tolerance <= self.value <= high + self.tolerance:
            return FAILS
        return UNDECIDED if self.fitted else HOLDS

    @property
    def said(self) -> str:
        """The rule in words."""
        more = f" ± {self.tolerance:.2g}" if self.tolerance else ""
        return f"around {self.value:g}{more}"


def above(bound: float) -> Rule:
    """The claim holds above a bound."""
    return Rule("above", bound)


def below(bound: float) -> Rule:
    """The claim holds below a bound."""
    return Rule("below", bound)


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim and what decides it."""

    place: str
    claim: str
    found: Estimate
    rule: Rule | Printed
    command: str

    @property
    def verdict(self) -> str:
        """One of holds, fails and undecided."""
        return self.rule.verdict(self.found)

    @property
    def number(self) -> str:
        """To read."""
        return f"{self.found.number:.4g}"

    @property
    def interval(self) -> str:
        """To read; empty where the number is exact."""
        low, high = self.found.low, self.found.high
        return f"[{low:.4g}, {high:.4g}]" if math.isfinite(low) and math.isfinite(high) else ""


def order(claim: Claim) -> tuple[int, str]:
    """Where a claim stands in the table."""
    return ORDER.index(claim.place.split()[0]), claim.place


def as_csv(claims: Sequence[Claim]) -> str:
    """All claims, a line each."""
    return formats.as_csv(
        HEADER, [(each.claim, each.place, each.verdict, each.number, each.interval, each.command) for each in claims]
    )


def table(claims: Sequence[Claim], form: str) -> str:
    """The one table, in a format of tabulate."""
    lines = [
        (each.place, each.claim, each.rule.said, f"{each.number} {each.interval}".rstrip(), each.verdict, each.command)
        for each in claims
    ]
    return formats.table(form, ("place", "claim", "holds if", "number", "verdict", "command"), lines)


def counts(claims: Sequence[Claim]) -> str:
    """How many hold, in words."""
    verdicts = [each.verdict for each in claims]
    told = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in (HOLDS, FAILS, UNDECIDED))
    return f"Of {len(claims)} statements: {told.replace('holds', 'hold').replace('fails', 'fail')}."
