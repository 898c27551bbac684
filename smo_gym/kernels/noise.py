"""Random numbers that are a function of an episode's key and an index, and of nothing else.

A generator that keeps a state gives a slot bits that depend on what was drawn before it. One that counts
(Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011) has no state: number ``index`` of an episode is
the same in every batch, on every thread, and however an episode is cut into calls.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from ..typing import Array
from . import inlined, instruction, interpreted, kernel
from .elementary import log, sincos
from .interpreted import GOLDEN, MIX_1, MIX_2, ONE

STREAMS = 64
"""Numbers that a sample may draw: index = 64 * (number of the sample within its episode) + stream.

A sensor's streams are 0-31, a disturbance's 32-47; 48-62 are drawn once an episode, at sample 0."""
_TWO_PI = 6.283185307179586


@instruction(interpreted.uniform)
def uniform(typingctx: Any, key: Any, index: Any) -> Any:
    """A number uniform in [0, 1), a multiple of 2^-52, for whole numbers key and index in [0, 2^52).

    ::

        z = (key G + index) G  mod 2^64         G = 2^64 / golden ratio
        uniform = top 52 bits of mix(z)         mix: the finaliser of splitmix64 (Steele, Lea and Flood 2014)

    All keys walk along one sequence of 2^64 numbers. Keys that differ by d begin d G mod 2^64 steps apart, and of all
    constants the golden ratio keeps its multiples farthest from 0: episodes of neighbouring keys, a million of them
    and each of 2^40 numbers, have none in common.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)

        def whole(x: Any) -> Any:  # adding 2^52 leaves a whole number in the low bits: there is no vector cast in AVX2
            return builder.bitcast(builder.fadd(x, ir.Constant(x.type, 2.0**52)), word)

        def times(z: Any, factor: int) -> Any:
            return builder.mul(z, ir.Constant(word, factor))

        def folded(z: Any, by: int) -> Any:
            return builder.xor(z, builder.lshr(z, ir.Constant(word, by)))

        key, index = args
        z = times(builder.add(times(whole(key), GOLDEN), whole(index)), GOLDEN)
        z = folded(times(folded(times(folded(z, 30), MIX_1), 27), MIX_2), 31)
        mantissa = builder.or_(builder.lshr(z, ir.Constant(word, 12)), ir.Constant(word, ONE))
        return builder.fsub(builder.bitcast(mantissa, key.type), ir.Constant(key.type, 1.0))

    return types.float64(types.float64, types.float64), codegen


@inlined
def two_normals(a: float, b: float) -> tuple[float, float]:
    """Two independent standard normals from two independent uniforms in [0, 1) (Box and Muller 1958).

    ``sqrt(-2 log(1 - a)) (cos 2 pi b, sin 2 pi b)``, at most 8.49 in size: 1 - a is at least 2^-52.
    """
    radius = math.sqrt(-2.0 * log(1.0 - a))
    sin, cos = sincos(_TWO_PI * b)
    return radius * cos, radius * sin


@kernel
def _uniforms(keys: Array, indices: Array, found: Array) -> None:
    for j in range(len(indices)):
        for i in range(len(keys)):
            found[j, i] = uniform(keys[i], indices[j])


def uniforms(keys: Array, indices: Sequence[float]) -> Array:
    """The numbers of some episodes at some indices, (indices, keys)."""
    found = np.empty((len(indices), len(keys)))
    _uniforms(np.ascontiguousarray(keys, dtype=np.float64), np.array(indices, dtype=np.float64), found)
    return found
