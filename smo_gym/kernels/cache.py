"""Numba's cache on disk, which may save time and never be the reason of a failure or of stale physics."""

import contextlib
import hashlib
import warnings
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache


def _digest() -> str:
    """Hash of the package's sources: any of them may stand in what a kernel inlines."""
    sources = sorted(Path(__file__).parents[1].rglob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


_SOURCES = _digest()


def _named(value: Any) -> Any:
    """What tells a function apart from others that are compiled from the same lines: what it closes over, by name."""
    function = getattr(value, "py_func", value)
    code = getattr(function, "__code__", None)
    if code is None:
        return repr(value)
    closed = tuple(_named(cell.cell_contents) for cell in function.__closure__ or ())
    return function.__module__, function.__qualname__, code.co_code, repr(code.co_consts), closed


_warned: set[str] = set()


def warn_once(error: Exception) -> None:
    """Say, once a process, that kernels are compiled anew although they should be cached."""
    if not _warned:
        _warned.add(str(error))
        warnings.warn(
            f"compiled kernels cannot be cached or read back ({type(error).__name__}: {error}); they are compiled in "
            "memory, some seconds in every process. NUMBA_CACHE_DIR names another folder",
            RuntimeWarning,
            stacklevel=2,
        )


class Cache(FunctionCache):
    """A kernel's cache, stamped with the sources of this package too; what is damaged is made anew.

    Numba recompiles when the kernel's own file changes but does not see a change in what the kernel inlines.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        index = self._cache_file
        index._source_stamp = (index._source_stamp, _SOURCES)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Without a pickle of what a function closes over, which for a compiled function is new in each process."""
        return sig, codegen.magic_tuple(), hashlib.sha256(repr(_named(self._py_func)).encode()).hexdigest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled kernel, or None where there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception as error:  # a file that is cut, empty or closed to us
            warn_once(error)
            with contextlib.suppress(Exception):
                # else a damaged index stands in the way of all later processes
                self.flush()  # type: ignore[no-untyped-call]
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled kernel, where there is room for it."""
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except Exception as error:
            warn_once(error)
