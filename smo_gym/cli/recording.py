"""One run, instant by instant, and its frames as an animation or a video."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..controllers import Agent, title
from ..envs.task import Task
from ..typing import Array
from ..validation import choice

Image = NDArray[np.uint8]
Encode = Callable[[Iterator[Image], float], bytes]
"""From frames and the time in s from one to the next to the bytes of a file."""
FORMATS = {".gif": "GIF", ".webp": "WEBP", ".mp4": "MP4"}
"""Kinds of files by their suffix."""
BETWEEN = {".gif": 0.04, ".webp": 0.04, ".mp4": 0.02}
"""Time in s between two frames of each, at least."""
LONGEST = 60.0
"""Longest recording in s."""


@dataclass(frozen=True, slots=True)
class Instant:
    """What has become of a run at one control instant."""

    time: float
    state: Array
    """The true state (4,)."""
    estimate: Array
    """The estimate (4,)."""
    failed: bool


def run(
    env: gymnasium.Env[Array, Array], agent: Agent, seconds: float, seed: int, options: dict[str, Any]
) -> Iterator[Instant]:
    """One episode of an observed environment, from its reset on, for so many seconds or until it fails.

    Raises:
        ValueError: the agent raises an error, which is the cause of this one, or its force is not finite.
    """
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    dt = task.control_period
    observation, info = env.reset(seed=seed, options=options)
    memory, failed = None, False
    yield Instant(0.0, info["state"], observation[-4:], failed)
    for k in range(1, round(seconds / dt) + 1):
        try:
            action, memory = agent.predict(observation[None], memory, np.array([k == 1]), True)
        except Exception as error:  # whatever a user's agent may raise
            place = f"t = {(k - 1) * dt:g} s"
            raise ValueError(f"{title(agent)}: cannot act at {place} ({type(error).__name__}: {error})") from error
        observation, _, failed, _, info = env.step(np.asarray(action)[0] / task.actuator.unit)  # agents say newtons
        yield Instant(k * dt, info["state"], observation[-4:], failed)
        if failed:
            return


def stride(suffix: str, control_period: float) -> int:
    """Control periods from one frame to the next in a kind of file."""
    return max(round(BETWEEN[suffix] / control_period), 1)


def record(
    env: gymnasium.Env[Array, Array], instants: Iterator[Instant], encode: Encode, every: int
) -> tuple[bytes, int, Instant]:
    """The file of a run, how many frames it has, and its last instant.

    Args:
        env: whose frames are taken, with the render mode "rgb_array".
        instants: of :func:`run`.
        encode: of :func:`encoder`.
        every: control periods from one frame to the next.
    """
    count, last = 0, None

    def frames() -> Iterator[Image]:
        nonlocal count, last
        for k, last in enumerate(instants):
            if k % every == 0 or last.failed:
                count += 1
                yield env.render()  # type: ignore[misc]

    data = encode(frames(), every * env.unwrapped.task.control_period)  # type: ignore[attr-defined]
    assert last is not None
    return data, count, last


def encoder(suffix: str) -> Encode:
    """What makes a kind of file of frames.

    Args:
        suffix: of the file, one of :data:`FORMATS`.

    Raises:
        ValueError: there is no such kind.
        ImportError: its extra is missing.
    """
    form = FORMATS[choice("kind of file", suffix, FORMATS)]
    if form == "MP4":
        return _video()
    try:
        from PIL.Image import Dither, fromarray
    except ImportError:
        raise ImportError('an animation needs Pillow: pip install "smo_gym[render]"') from None

    def animation(frames: Iterator[Image], between: float) -> bytes:
        first = fromarray(next(frames))
        palette = first.quantize(48, kmeans=4)  # one for all: nothing flickers

        def images() -> Iterator[Any]:
            for frame in frames:
                image = fromarray(frame)
                yield image.quantize(palette=palette, dither=Dither.NONE) if form == "GIF" else image

        if form == "GIF":
            first = first.quantize(palette=palette, dither=Dither.NONE)
        file = io.BytesIO()
        options = {"save_all": True, "append_images": images(), "duration": round(1000 * between), "loop": 0}
        first.save(file, form, optimize=True, **options)
        return file.getvalue()

    return animation


def _video() -> Encode:
    try:
        from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter  # type: ignore[import-untyped]
    except ImportError:
        raise ImportError('a video needs moviepy: pip install "smo_gym[video]"; .gif and .webp do not') from None

    def video(frames: Iterator[Image], between: float) -> bytes:
        first = next(frames)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.mp4"
            size, everywhere = first.shape[1::-1], ["-pix_fmt", "yuv420p"]  # other forms play in few places
            with FFMPEG_VideoWriter(str(path), size, fps=1.0 / between, ffmpeg_params=everywhere) as writer:
                for frame in chain([first], frames):
                    writer.write_frame(frame)
            return path.read_bytes()

    return video
