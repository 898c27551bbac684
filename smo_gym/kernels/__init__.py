"""The compiled ground floor: elementary functions, the equations of motion, Runge-Kutta and batches of slots.

Every equation is a scalar function marked :func:`inlined`; a loop over a batch is marked :func:`kernel`. No
fast-math flag is set and multiply-add is written out as :func:`~smo_gym.kernels.elementary.fma`, so the compiler may
vectorise but not change a rounding: a slot's result does not depend on the batch it is in, on the number of threads
or on the width of the machine's vectors.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def _digest() -> str:
    """Hash of all sources that other files' kernels inline."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


_SOURCES = _digest()


def inlined(function: F) -> F:
    """Compile a scalar function that is always inlined into the kernel which calls it.

    ``error_model="numpy"`` makes a division by zero give inf or NaN: the branch that would raise keeps the loop around
    it from being vectorised.
    """
    return cast(F, numba.njit(error_model="numpy", forceinline=True)(function))


def plain(function: F) -> F:
    """The Python function behind an inlined one, for arrays and symbols."""
    return cast(F, function.py_func)  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile a loop over a batch; it runs without the GIL and is cached on disk.

    Numba recompiles when the kernel's own file changes but does not see a change in what the kernel inlines. The cache
    is therefore stamped with the sources of this package too, so that no stale physics is ever run.
    """
    dispatcher: Any = numba.njit(error_model="numpy", nogil=True)(function)
    try:
        dispatcher.enable_caching()
        index = dispatcher._cache._cache_file
        index._source_stamp = (index._source_stamp, _SOURCES)
    except (RuntimeError, AttributeError):
        # no folder to cache in, or another Numba keeps its stamp elsewhere: compile in every process
        dispatcher = numba.njit(error_model="numpy", nogil=True)(function)
    return cast(F, dispatcher)
