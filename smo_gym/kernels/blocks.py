"""Blocks: compiled loops over the lanes of a workspace, all of one signature, called by address.

A block is ``function(signals, own, lanes)``. Both arrays are rows of :data:`~smo_gym.kernels.batch.LANES` numbers, row
r of lane i at ``r * LANES + i``: ``signals`` holds what components exchange, ``own`` what belongs to the block's part
alone, settings and state alike. Names of rows are plain integers in a module: the compiler then knows every offset and
vectorises, which it does not where they stand in a tuple or an attribute.
"""

from collections.abc import Callable
from functools import cache
from itertools import accumulate
from typing import Any, cast

from numba import types

from ..typing import Array, State
from . import COMPILES, inlined, instruction, kernel
from .batch import LANES
from .elementary import rounded

Block = Callable[[Array, Array, int], None]


def offsets(*sizes: int) -> tuple[int, ...]:
    """Where each group of rows begins, and behind the last how many rows there are."""
    return tuple(accumulate(sizes, initial=0))


X, Y0, Y, XHAT, U, XD, ALIVE, FAILED, REWARD, FORCE, PUSH, STAMP, SIGNALS = offsets(4, 2, 2, 4, 1, 4, 1, 1, 1, 1, 2, 1)
"""Rows of what components exchange: the state; the measurement one sample ago and now; the estimate; the force that is
asked for, within the limit; where the state should be; 1 while a run goes on; 1 from where it fails on; the reward of
the last control period. Where they are not ideal, over the sampling period: the mean force that reaches the cart; a
disturbance's force on the cart and torque about the pivot; and how much later than its instant a sample was taken."""


@inlined
def at(rows: Array, row: int, i: int) -> float:
    """A row's number in lane i."""
    return rows[row * LANES + i]  # type: ignore[no-any-return]


@inlined
def two(rows: Array, row: int, i: int) -> tuple[float, float]:
    """Two rows' numbers in lane i."""
    return rows[row * LANES + i], rows[(row + 1) * LANES + i]


@inlined
def four(rows: Array, row: int, i: int) -> State:
    """Four rows' numbers in lane i."""
    return (
        rows[row * LANES + i],
        rows[(row + 1) * LANES + i],
        rows[(row + 2) * LANES + i],
        rows[(row + 3) * LANES + i],
    )


@inlined
def put(rows: Array, row: int, i: int, value: float) -> None:
    """Set a row's number in lane i."""
    rows[row * LANES + i] = value


@inlined
def put_two(rows: Array, row: int, i: int, values: tuple[float, float]) -> None:
    """Set two rows' numbers in lane i."""
    rows[row * LANES + i], rows[(row + 1) * LANES + i] = values


@inlined
def put_four(rows: Array, row: int, i: int, values: State) -> None:
    """Set four rows' numbers in lane i."""
    rows[row * LANES + i] = values[0]
    rows[(row + 1) * LANES + i] = values[1]
    rows[(row + 2) * LANES + i] = values[2]
    rows[(row + 3) * LANES + i] = values[3]


@inlined
def finite(values: State) -> bool:
    """Whether all four numbers are: x - x is 0, or NaN."""
    a, b, c, d = values
    return (a - a) + (b - b) + (c - c) + (d - d) == 0.0


_TWO_PI = 6.283185307179586


@inlined
def error(signals: Array, i: int, wrap: float) -> State:
    """What a law should bring to zero, xhat - x_d in lane i.

    With ``wrap`` = 1 the error of the angle is the one within half a turn: an encoder goes on counting, and a rod that
    has turned is where it was.
    """
    xhat, x_d = four(signals, XHAT, i), four(signals, XD, i)
    angle = xhat[1] - x_d[1]
    turns = wrap * rounded(angle / _TWO_PI)
    return xhat[0] - x_d[0], angle - _TWO_PI * turns, xhat[2] - x_d[2], xhat[3] - x_d[3]


SIGNATURE = types.void(types.float64[::1], types.float64[::1], types.int64)
_interpreted: dict[int, Block] = {}


def block(function: Block) -> Block:
    """Compile a block; cached on disk like a kernel, where its file can be written beside.

    The cache is made anew when that file or this package changes. What a block of your own inlines belongs in its file:
    a change in another one of yours is not seen.
    """
    return kernel(function)


@cache
def address(function: Block) -> int:
    """Where a block's machine code is, in this process.

    Raises:
        TypeError: ``function`` is no block.
        numba.core.errors.NumbaError: it cannot be compiled for a block's signature.
    """
    if not COMPILES:
        _interpreted[id(function)] = function
        return id(function)
    if not hasattr(function, "overloads"):
        raise TypeError(f"{function!r} must be compiled: mark it with @smo_gym.kernels.blocks.block")
    compiled = cast(Any, function)
    compiled.compile(SIGNATURE.args)
    found = compiled.overloads[SIGNATURE.args]
    if found.signature.return_type != types.void:
        raise TypeError(f"{function!r} must return nothing: a block writes into rows")
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def _call_interpreted(where: int, signals: Array, own: Array, lanes: int) -> None:
    _interpreted[int(where)](signals, own, lanes)


@instruction(_call_interpreted)
def call(typingctx: Any, where: Any, signals: Any, own: Any, lanes: Any) -> Any:
    """Call the block at an address; an error that it raises goes on to Python."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(SIGNATURE.return_type, SIGNATURE.args).as_pointer()
        pointer = builder.inttoptr(args[0], kind)
        status, _ = convention.call_function(builder, pointer, SIGNATURE.return_type, SIGNATURE.args, args[1:])
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.void(types.int64, *SIGNATURE.args), codegen
