"""The compiled ground floor: elementary functions, the equations of motion, Runge-Kutta and batches of slots.

Every equation is a scalar function marked :func:`inlined`; a loop over a batch is marked :func:`kernel`. No
fast-math flag is set and multiply-add is written out as :func:`~smo_gym.kernels.elementary.fma`, so the compiler may
vectorise but not change a rounding: a slot's result does not depend on the batch it is in, on the number of threads
or on the width of the machine's vectors.

With ``NUMBA_DISABLE_JIT=1`` the same functions run as Python, to the same bits and some thousand times slower.
"""

import platform
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from llvmlite import binding
from numba.extending import intrinsic as _intrinsic

from .cache import Cache, warn_once

F = TypeVar("F", bound=Callable[..., Any])
config: Any = numba.config
COMPILES: bool = not config.DISABLE_JIT
# Numba's own types describe the generator, not the function that it makes.
intrinsic: Callable[[Callable[..., Any]], Any] = _intrinsic


def fuses() -> bool:
    """Whether the code that Numba makes here may use the processor's fused multiply-add."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return True  # every 64-bit processor of the other kinds that Numba supports has it
    features = config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten()
    return "+fma" in features.split(",")


if COMPILES and not fuses():
    warnings.warn(
        "this processor (or NUMBA_CPU_NAME, NUMBA_CPU_FEATURES) has no fused multiply-add: results are the same to the "
        "last bit, but everything takes some hundred times longer",
        RuntimeWarning,
        stacklevel=2,
    )


def instruction(interpreted: F) -> Callable[[Callable[..., Any]], F]:
    """An intrinsic of the compiled code; the Python function in its place where nothing is compiled."""

    def choose(definition: Callable[..., Any]) -> F:
        return cast(F, intrinsic(definition)) if COMPILES else interpreted

    return choose


def inlined(function: F) -> F:
    """Compile a scalar function that is always inlined into the kernel which calls it.

    ``error_model="numpy"`` makes a division by zero give inf or NaN: the branch that would raise keeps the loop around
    it from being vectorised.
    """
    return cast(F, numba.njit(error_model="numpy", forceinline=True)(function))


def plain(function: F) -> F:
    """The Python function behind an inlined one, for arrays and symbols."""
    return cast(F, getattr(function, "py_func", function))


def kernel(function: F, on_disk: bool = True) -> F:
    """Compile a loop over a batch; it runs without the GIL and is cached on disk (:mod:`smo_gym.kernels.cache`)."""
    dispatcher: Any = numba.njit(error_model="numpy", nogil=True)(function)
    if COMPILES and on_disk:
        try:
            dispatcher._cache = Cache(dispatcher.py_func)
        except Exception as error:  # no folder to cache in, or another Numba keeps its cache elsewhere
            warn_once(error)
    return cast(F, dispatcher)
