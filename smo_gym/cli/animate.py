"""Animate one run: the cart pendulum under LQR or SMC, and the observer's estimate as a ghost that catches up.

    smo-gym animate --out docs/animation.gif

The plant is drawn at random, and no force is beyond 30 N.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from .. import ObserverWrapper, files
from ..evaluation import scenario
from ..validation import number, unknown
from .arguments import Parser, real
from .entry import command

Image = NDArray[np.uint8]
FORMATS = {".gif": "GIF", ".webp": "WEBP"}
FRAME = 0.04  # s between two frames, at least


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
    for what, name, known in (
        ("controller", args.controller, place.controllers),
        ("case", args.case, place.initial_states.value),
        ("kind of file", args.out.suffix, FORMATS),
    ):
        if name not in known:
            raise ValueError(unknown(what, name, known))
    number("--seconds", args.seconds, above=FRAME, below=60.0)
    files.prepare(args.out.parent, names=[args.out.name])
    frames = record(place, args.controller, args.case, args.seconds, args.seed)
    files.write_bytes(args.out, encode(frames, FORMATS[args.out.suffix]))
    print(f"{len(frames)} frames, {args.out.stat().st_size / 1e6:.2f} MB: {args.out}")
    return 0


def record(place: scenario.Scenario, controller: str, case: str, seconds: float, seed: int) -> list[Image]:
    """Frames (height, width, 3) of one run of a scenario's controller and observer, on time."""
    settings, dt = place.controllers[controller], place.control_period.value
    env = gymnasium.make(place.environment, render_mode="rgb_array", control_period=dt)
    env = ObserverWrapper(env, settings.observer.build(True))
    agent = place.agent(controller)
    observation, _ = env.reset(seed=seed, options={"state": place.initial_states.value[case]})
    frames: list[Any] = [env.render()]
    state, over = None, False
    for k in range(1, round(seconds / dt) + 1):
        if over:
            break
        action, state = agent.predict(observation, state)
        observation, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
        if k % round(FRAME / dt) == 0:
            frames.append(env.render())
    env.close()
    return frames


def encode(frames: Sequence[Image], form: str) -> bytes:
    """An animation that repeats.

    Raises:
        ImportError: Pillow is missing.
    """
    try:
        from PIL.Image import Dither, fromarray
    except ImportError:
        raise ImportError('an animation needs Pillow: pip install "smo_gym[render]"') from None
    palette = fromarray(frames[0]).quantize(48, kmeans=4)  # one for all: nothing flickers
    images = [fromarray(frame) for frame in frames]
    if form == "GIF":
        images = [image.quantize(palette=palette, dither=Dither.NONE) for image in images]
    file = io.BytesIO()
    options = {"save_all": True, "append_images": images[1:], "duration": round(1000 * FRAME), "loop": 0}
    images[0].save(file, form, optimize=True, **options)
    return file.getvalue()
