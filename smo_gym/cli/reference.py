"""Compute the minimum-energy reference, equation (53), that a tracking scenario follows.

    smo-gym reference                              # what ships with the package, from configs/tracking.yaml
    smo-gym reference --horizon 6 --out mine.json

Needs the extra "reference" (CasADi and IPOPT).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .. import files
from ..evaluation import scenario
from ..reference import ReferenceNotFound, minimum_energy
from ..validation import multiple
from .arguments import Parser, real, whole
from .entry import command


@command("reference")
def main(arguments: Sequence[str] | None = None) -> int:
    """Solve, check by integration, write; 0 when all went well, 2 when there is no such reference."""
    settings = scenario.named("tracking")
    assert settings.reference is not None
    (start,) = settings.initial_states.value.values()
    parser = Parser("reference", __doc__)
    add = parser.add_argument
    names = ("H", "THETA", "H_DOT", "THETA_DOT")
    add("--start", type=real, nargs=4, default=start, metavar=names, help=f"initial state (default {start})")
    add(
        "--end",
        type=real,
        nargs=4,
        default=settings.reference.end.value,
        metavar=names,
        help="final state (default 0)",
    )
    add("--horizon", type=real, default=settings.horizon.value, help="s (default %(default)s)")
    add("--force-limit", type=real, default=settings.reference.force_limit.value, help="N (default %(default)s)")
    add(
        "--elements",
        type=whole(1),
        default=settings.reference.elements.value,
        help="intervals of constant force (default %(default)s)",
    )
    add("--out", type=Path, default=Path("reference.json"), metavar="FILE", help="default %(default)s")
    args = parser.parse_args(arguments)
    files.prepare(args.out.parent, names=[args.out.name])
    multiple("horizon / elements", args.horizon / args.elements, "1 ms", 0.001)
    try:
        found = minimum_energy(args.start, args.end, args.horizon, args.force_limit, args.elements)
        finer = minimum_energy(args.start, args.end, args.horizon, args.force_limit, args.elements, refine=2)
    except ReferenceNotFound as error:
        raise ValueError(error) from None
    miss = np.abs(found.trajectory(0.001)[:, -1] - found.xT).max()
    files.write(args.out, found.to_json() + "\n")
    print(f"cost {found.cost:.6g} J s, {100 * abs(finer.cost / found.cost - 1):.2g} % from a twice finer mesh")
    print(
        f"its own force, integrated in steps of 1 ms, misses the end by {miss:.1e}; peak {np.abs(found.u).max():.1f} N"
    )
    print(f"written to {args.out}")
    return 0
