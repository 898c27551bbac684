"""What the compiler made of the package's blocks: vector instructions, scalar ones, calls.

    python benchmarks/assembly.py

Packed instructions are the loop over lanes; scalar ones are the same loop for a slot that is alone, and settings that
all lanes share. A block that calculates without packed ones takes several times longer: it is named in the end, and the
exit status is 1.
"""

import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numba
from tabulate import tabulate

import smo_gym
from smo_gym.kernels.blocks import SIGNATURE

_ARITHMETIC = r"\tv?(?:add|sub|mul|div|min|max|fn?m(?:add|sub)\w*){}\b"
COUNTED = {
    "packed": _ARITHMETIC.format("pd"),
    "scalar": _ARITHMETIC.format("sd"),
    "zmm": r"%zmm\d+",
    "ymm": r"%ymm\d+",
}
CALLED = r"\t(?:movabsq\t\$|callq\t)([A-Za-z_]\w*)"
COUNTERS = {"NRT_incref", "NRT_decref"}
"""Of references to arrays: called once a block where it is vectorised."""


def blocks() -> Iterator[tuple[str, Any]]:
    """All blocks of the package by name: compiled functions with a block's parameters."""
    for module in pkgutil.walk_packages(smo_gym.__path__, "smo_gym."):
        if module.name.endswith("__main__"):
            continue
        try:
            found = vars(import_module(module.name))
        except ImportError as error:  # an extra is not installed
            print(f"{module.name} is left out: {error}")
            continue
        for name, value in found.items():
            function = getattr(value, "py_func", None)
            if function is None or function.__module__ != module.name:
                continue
            if [*inspect.signature(function).parameters] == ["signals", "own", "lanes"]:
                yield f"{module.name.removeprefix('smo_gym.')}.{name}", value


def assembly(block: Any) -> str:
    """The instructions of a block itself, compiled anew: the cache keeps machine code without a listing."""
    fresh: Any = numba.jit(**block.targetoptions)(block.py_func)
    fresh.compile(SIGNATURE.args)
    name = fresh.get_compile_result(SIGNATURE).fndesc.llvm_func_name
    text = fresh.inspect_asm(SIGNATURE.args)
    return str(text[text.index(f"\n{name}:") :].partition(".Lfunc_end")[0])


def main() -> None:
    rows, scalar = [], []
    for name, block in blocks():
        text = assembly(block)
        counts = {kind: len(re.findall(pattern, text)) for kind, pattern in COUNTED.items()}
        called = {*re.findall(CALLED, text)} - COUNTERS
        rows.append((name, *counts.values(), ", ".join(sorted(called)) or "none"))
        if counts["zmm"] + counts["ymm"] == 0:
            scalar.append(name)
    print(tabulate(rows, ("block", "packed arithmetic", "scalar arithmetic", "zmm", "ymm", "calls")))
    if scalar:
        print(f"\nnot vectorised: {', '.join(scalar)}")
    sys.exit(1 if scalar else 0)


if __name__ == "__main__":
    main()
