"""What the machine's instructions do, in Python: used where nothing is compiled (``NUMBA_DISABLE_JIT=1``)."""

import math
import struct
from fractions import Fraction

_INT64 = struct.Struct("<q")
_FLOAT64 = struct.Struct("<d")
_MASK = 2**64 - 1
GOLDEN, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""2**64 over the golden ratio, and the multipliers of splitmix64."""
ONE = 0x3FF0000000000000
"""The bits of 1.0."""


def fma(a: float, b: float, c: float) -> float:
    """``a * b + c`` with one rounding, from exact fractions."""
    a, b, c = float(a), float(b), float(c)
    if not math.isfinite(c) and math.isfinite(a) and math.isfinite(b):
        return c  # whatever a * b overflows to
    if not (math.isfinite(a) and math.isfinite(b)):
        return a * b + c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if not exact:
        return a * b + c  # the sign of a zero
    try:
        return float(exact)
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


def bits(x: float) -> int:
    """The 64 bits of a float as an integer."""
    return int(_INT64.unpack(_FLOAT64.pack(x))[0])


def from_bits(n: int) -> float:
    """The float whose 64 bits are the integer's low ones."""
    return float(_FLOAT64.unpack((n & _MASK).to_bytes(8, "little"))[0])


def mixed(z: int) -> int:
    """The finaliser of splitmix64: 64 bits, each of which depends on all 64 of z."""
    z = (z ^ z >> 30) * MIX_1 & _MASK
    z = (z ^ z >> 27) * MIX_2 & _MASK
    return z ^ z >> 31


def uniform(key: float, index: float) -> float:
    """:func:`smo_gym.kernels.noise.uniform` on Python's integers."""
    z = (bits(key + 2.0**52) * GOLDEN + bits(index + 2.0**52)) * GOLDEN & _MASK
    return from_bits(mixed(z) >> 12 | ONE) - 1.0
