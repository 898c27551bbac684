"""Gains of the article's observer, named as in its Table 3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from numpy.typing import ArrayLike

from ..article import OBSERVER_GAINS
from ..validation import array, choice, mapping


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
