"""Animate one run: the cart pendulum under LQR or SMC, and the observer's estimate as a ghost that catches up.

    smo-gym animate --out docs/animation.gif

The plant is drawn at random, and no force is beyond 30 N. Any other controller or environment: smo-gym watch.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import gymnasium

from .. import ObserverWrapper, files
from ..evaluation import scenario
from ..validation import choice, number
from . import recording
from .arguments import Parser, real
from .entry import command


@command("animate")
def main(arguments: Sequence[str] | None = None) -> int:
    """Write the animation; 0 when all went well, 2 for a bad argument or a missing extra, 130 when interrupted."""
    place = scenario.named("initial-conditions")
    parser = Parser("animate", __doc__)
    add = parser.add_argument
    add("--controller", default="lqr", help="lqr (default) or smc")
    add("--case", default="1", help="initial state of Table 5: 1 (default), 2, 3 or 4")
    add("--seconds", type=real, default=6.0, help="length of the run (default 6)")
    parser.seed("the random plant")
    add("--out", type=Path, default=Path("animation.gif"), metavar="FILE", help=".gif or .webp (default animation.gif)")
    args = parser.parse_args(arguments)
    settings = place.controllers[choice("controller", args.controller, place.controllers)]
    start = place.starts(args.controller)[choice("case", args.case, place.initial_states.value)]
    encode = recording.encoder(choice("kind of file", args.out.suffix, (".gif", ".webp")))
    number("--seconds", args.seconds, above=recording.BETWEEN[args.out.suffix], below=recording.LONGEST)
    files.prepare(args.out.parent, names=[args.out.name])
    dt = place.control_period.value
    env = gymnasium.make(place.environment, render_mode="rgb_array", control_period=dt)
    env = ObserverWrapper(env, settings.observer.build(True))
    instants = recording.run(env, place.agent(args.controller), args.seconds, args.seed, {"state": start})
    data, count, _ = recording.record(env, instants, encode, recording.stride(args.out.suffix, dt))
    env.close()
    files.write_bytes(args.out, data)
    print(f"{count} frames, {len(data) / 1e6:.2f} MB: {args.out}")
    return 0
