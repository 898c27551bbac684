"""What the compiler made of the kernels: vector instructions, scalar ones, calls.

    python benchmarks/assembly.py

The packed instructions are the loop over a block of lanes; the scalar ones are the same loop for what is left of it.
Calls are counted outside loops (allocation, reference counts); a call to sin, cos, tanh, exp or fma would be named.
"""

import re
from typing import Any

import gymnasium
import numpy as np
from tabulate import tabulate

from smo_gym import VectorObserverWrapper
from smo_gym.observers import sliding_mode
from smo_gym.plant import _advance


def main() -> None:
    env = VectorObserverWrapper(gymnasium.make_vec("SMOPendulum-v0", 2))
    env.reset(seed=0)
    env.step(np.zeros((2, 1)))
    rows = []
    kernels: dict[str, Any] = {"plant": _advance, "observer": sliding_mode._observe}
    for name, kernel in kernels.items():
        kernel.recompile()  # the cache keeps machine code, not its listing
        (text,) = kernel.inspect_asm().values()
        named = sorted(set(re.findall(r"\b(?:sin|cos|tanh|expm?1?|fma)\b(?=@|\n)", text)))
        counts = [len(re.findall(pattern, text)) for pattern in (r"vf?n?m\w+pd", r"vf?n?m\w+sd", "zmm", "ymm")]
        rows.append((name, *counts, named or "none"))
    header = ("kernel", "packed multiply/fma", "scalar multiply/fma", "zmm", "ymm", "calls to mathematics")
    print(tabulate(rows, header))


if __name__ == "__main__":
    main()
