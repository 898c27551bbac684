"""One frame of the cart pendulum with pygame-ce, on a window (``human``) or as an array (``rgb_array``)."""

from __future__ import annotations

import contextlib
import io
import math
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..typing import Array
from .task import Task

if TYPE_CHECKING:
    import pygame

Point = tuple[float, float]

MODES = ["human", "rgb_array"]
SIZE = (800, 400)
"""Width and height of a frame in pixels."""
CART, BOB, ESTIMATE, REFERENCE, FORCE = "#4D5866", "#D55E00", "#0072B2", "#009E73", "#E69F00"
MEASURED = "#CC79A7"
"""Colours: those of Okabe and Ito, and a grey."""
_INK, _PALE, _PAPER = "#1A1A1A", "#B8BEC6", "#FFFFFF"
_FINE = 2  # times finer than the frame is what is drawn, then smoothed
_RODS = 8.0  # rod lengths that a frame is wide
_FRAMES_A_SECOND = 50  # of a window, at most


@dataclass(frozen=True, slots=True)
class Scene:
    """What there is to see at one instant."""

    time: float
    """Time since the episode's start in s."""
    position: Array
    """h in m and theta in rad, then whatever else the state has, (2 or more,)."""
    rod: float
    """Length of this episode's rod in m."""
    force: float
    """Force in N that the actuator applied until now."""
    desired: Array | None
    """Where h in m and theta in rad should be, (2 or more,); None without a reference."""
    measured: Array | None = None
    """What the sensor says of h in m and theta in rad, (2,); None where it is exact."""


def bob(task: Task, position: Array, rod: float) -> Point:
    """Where the bob is, in m to the right of the track's middle and above the track.

    (h + l sin theta, l cos theta) for g > 0, where theta is from the upward vertical; for g < 0 the same model hangs:
    (h + l sin theta, -l cos theta). The velocities and heights give the kinetic and potential energy of (53).
    """
    h, theta = position[:2]
    return h + rod * math.sin(theta), math.copysign(rod, task.params.gravity) * math.cos(theta)


def to_pixel(task: Task, position: Array, point: Point) -> Point:
    """Where a point in m falls on a frame that shows the cart at ``position``, from the upper left corner."""
    scale = SIZE[0] / (_RODS * task.params.rod_length)
    return SIZE[0] / 2 + scale * (point[0] - _camera(task, position)), SIZE[1] / 2 - scale * point[1]


def _camera(task: Task, position: Array) -> float:
    """The middle of the frame in m: at rest while the cart is in its middle half, then going along with it."""
    reach = _RODS * task.params.rod_length / 4
    h = float(position[0])
    return h - min(max(h, -reach), reach)


def _drawable(position: Array) -> Array:
    """A position that has a pixel: one far away stays far outside, one that is no number comes to the middle."""
    return np.clip(np.nan_to_num(position[:2]), -1e3, 1e3)


def load() -> Any:
    """Import pygame, without its greeting.

    Raises:
        ImportError: it is missing.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            import pygame
    except ImportError:
        raise ImportError('rendering needs pygame-ce: pip install "smo_gym[render]"') from None
    return pygame


def closed_by_user() -> bool:
    """Whether somebody has asked a window to close since it was opened."""
    pg = load()
    return bool(pg.display.get_init() and pg.event.peek(pg.QUIT))


class Renderer:
    """Draws scenes of a task.

    Args:
        mode: "human" or "rgb_array".
        task: whose track, rod and gravity are drawn.

    Raises:
        ImportError: pygame-ce is missing.
        RuntimeError: "human", but there is no display.
    """

    def __init__(self, mode: str, task: Task) -> None:
        self._pygame = load()
        self._mode, self._task = mode, task
        self._scale = _FINE * SIZE[0] / (_RODS * task.params.rod_length)  # fine pixels a metre
        self._unit = self._scale * task.params.rod_length / 10  # a length to size things by, fine pixels
        self._pygame.font.init()
        self._text = self._pygame.font.Font(None, 22 * _FINE)
        self._small = self._pygame.font.Font(None, 17 * _FINE)
        self._window: pygame.Surface | None = None
        if mode == "human":
            self._open()

    def __reduce__(self) -> tuple[type[Renderer], tuple[str, Task]]:
        """A copy is made anew: pygame's fonts and windows cannot be copied."""
        return Renderer, (self._mode, self._task)

    def _open(self) -> None:
        pg = self._pygame
        try:
            pg.display.init()
            # without a display SDL falls back on a driver that shows nothing, which only a test asks for by name
            unseen = pg.display.get_driver() in ("dummy", "offscreen") and not (
                os.environ.get("SDL_VIDEODRIVER") or os.environ.get("SDL_VIDEO_DRIVER")
            )
            reason = "SDL found no screen" if unseen else ""
        except pg.error as error:
            reason = str(error)
        if reason:
            pg.display.quit()
            raise RuntimeError(f"render_mode='human' needs a display ({reason}): use render_mode='rgb_array'")
        self._window = pg.display.set_mode(SIZE)
        pg.display.set_caption("smo_gym")
        self._clock = pg.time.Clock()
        self._next = -math.inf  # s, of the episode

    def draw(self, scene: Scene, ghost: Array | None) -> NDArray[np.uint8] | None:
        """Draw a scene and an estimated state (2 or more,), where there is one.

        Returns:
            The frame (height, width, 3) for "rgb_array"; None for "human", whose window shows 50 of them a second.
        """
        if self._mode == "rgb_array":
            pixels = np.frombuffer(self._pygame.image.tobytes(self._frame(scene, ghost), "RGB"), np.uint8)
            return pixels.reshape(SIZE[1], SIZE[0], 3).copy()
        if self._window is None:
            self._open()
        assert self._window is not None
        self._pygame.event.pump()
        if scene.time == 0.0 or scene.time > self._next - 1e-9:
            self._next = scene.time + 1.0 / _FRAMES_A_SECOND
            self._window.blit(self._frame(scene, ghost), (0, 0))
            self._pygame.display.flip()
            self._clock.tick(_FRAMES_A_SECOND)
        return None

    def close(self) -> None:
        """Close the window; again does nothing."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _frame(self, scene: Scene, ghost: Array | None) -> pygame.Surface:
        pg = self._pygame
        scene = replace(scene, position=_drawable(scene.position))
        canvas = pg.Surface((SIZE[0] * _FINE, SIZE[1] * _FINE), depth=32)
        canvas.fill(_PAPER)
        self._track(canvas, scene)
        if scene.desired is not None:
            self._outline(canvas, scene, scene.desired, REFERENCE)
        self._pendulum(canvas, scene)
        if ghost is not None:
            self._outline(canvas, scene, _drawable(ghost), ESTIMATE)
        if scene.measured is not None:
            self._crosses(canvas, scene, _drawable(scene.measured))
        self._arrow(canvas, scene)
        self._captions(canvas, scene, ghost)
        frame: pygame.Surface = pg.transform.smoothscale(canvas, SIZE)
        return frame

    def _at(self, scene: Scene, point: Point) -> Point:
        x, y = to_pixel(self._task, scene.position, point)
        return x * _FINE, y * _FINE

    def _cart(self, scene: Scene, position: Array) -> pygame.Rect:
        rect: pygame.Rect = self._pygame.Rect(0, 0, round(7 * self._unit), round(3.4 * self._unit))
        rect.center = tuple(map(round, self._at(scene, (float(position[0]), 0.0))))
        return rect

    def _track(self, canvas: pygame.Surface, scene: Scene) -> None:
        """The track, its ends where they are in sight, and half metres."""
        pg, u, limit = self._pygame, self._unit, self._task.track_limit
        width, y = canvas.get_width(), canvas.get_height() / 2
        middle, half = _camera(self._task, scene.position), width / 2 / self._scale
        left, right = (self._at(scene, (h, 0.0))[0] for h in (max(middle - half, -limit), min(middle + half, limit)))
        pg.draw.line(canvas, _PALE, (left, y), (right, y), round(0.5 * u))
        for end, side in ((left, -limit), (right, limit)):
            if abs(side - middle) <= half:
                pg.draw.line(canvas, _INK, (end, y - 2.4 * u), (end, y + 2.4 * u), round(0.7 * u))
        floor = canvas.get_height() - 3.4 * u
        for k in range(math.ceil((middle - half) / 0.5), math.floor((middle + half) / 0.5) + 1):
            if abs(0.5 * k) > limit:
                continue
            x, _ = self._at(scene, (0.5 * k, 0.0))
            pg.draw.line(canvas, _PALE, (x, floor), (x, floor + 0.8 * u), round(0.2 * u))
            label = self._small.render(f"{0.5 * k:g} m", True, "#5A6470")
            place = label.get_rect(midtop=(x, floor + u))
            if canvas.get_rect().contains(place):
                canvas.blit(label, place)

    def _pendulum(self, canvas: pygame.Surface, scene: Scene) -> None:
        pg, u = self._pygame, self._unit
        cart, end = self._cart(scene, scene.position), self._at(scene, bob(self._task, scene.position, scene.rod))
        pg.draw.rect(canvas, CART, cart, border_radius=round(0.7 * u))
        pg.draw.line(canvas, _INK, cart.center, end, round(0.7 * u))
        pg.draw.circle(canvas, _PAPER, cart.center, 0.6 * u)
        pg.draw.circle(canvas, _INK, cart.center, 0.6 * u, round(0.25 * u))
        pg.draw.circle(canvas, BOB, end, 1.4 * u)

    def _outline(self, canvas: pygame.Surface, scene: Scene, position: Array, colour: str) -> None:
        """A cart pendulum that is not there, with this episode's rod: what differs from the plant is h and theta."""
        pg, u = self._pygame, self._unit
        cart, end = self._cart(scene, position), self._at(scene, bob(self._task, position, scene.rod))
        pg.draw.rect(canvas, colour, cart, round(0.35 * u), border_radius=round(0.7 * u))
        pg.draw.line(canvas, colour, cart.center, end, round(0.35 * u))
        pg.draw.circle(canvas, colour, end, 1.4 * u, round(0.35 * u))

    def _crosses(self, canvas: pygame.Surface, scene: Scene, position: Array) -> None:
        """Where cart and bob are by what was measured."""
        u = self._unit
        for point in ((float(position[0]), 0.0), bob(self._task, position, scene.rod)):
            x, y = self._at(scene, point)
            for side in (-1.0, 1.0):
                ends = (x - 0.9 * u, y - side * 0.9 * u), (x + 0.9 * u, y + side * 0.9 * u)
                self._pygame.draw.line(canvas, MEASURED, *ends, round(0.5 * u))

    def _arrow(self, canvas: pygame.Surface, scene: Scene) -> None:
        """The force on the cart: 1.5 rods, always in sight, for the largest (30 N where there is no limit)."""
        pg, u = self._pygame, self._unit
        largest = self._task.force_limit if math.isfinite(self._task.force_limit) else 30.0
        length = 15 * u * min(abs(scene.force) / largest, 1.0)
        if not length > 0.1 * u:
            return
        sign = math.copysign(1.0, scene.force)
        cart = self._cart(scene, scene.position)
        tail, y = (cart.right if sign > 0 else cart.left) + sign * 0.6 * u, cart.centery
        tip, head = tail + sign * length, min(1.6 * u, length)
        pg.draw.line(canvas, FORCE, (tail, y), (tip - sign * head, y), round(0.8 * u))
        neck = tip - sign * head
        pg.draw.polygon(canvas, FORCE, [(tip, y), (neck, y - 0.7 * head), (neck, y + 0.7 * head)])

    def _captions(self, canvas: pygame.Surface, scene: Scene, ghost: Array | None) -> None:
        pg, u = self._pygame, self._unit
        time = self._text.render(f"t = {scene.time:.2f} s", True, _INK)
        canvas.blit(time, (2 * u, 1.6 * u))
        keys = [(FORCE, f"force {scene.force:+.1f} N")]
        keys += [(ESTIMATE, "estimate")] * (ghost is not None)
        keys += [(REFERENCE, "reference")] * (scene.desired is not None)
        keys += [(MEASURED, "measured")] * (scene.measured is not None)
        x = 16 * u
        for colour, text in keys:
            label = self._text.render(text, True, _INK)
            pg.draw.circle(canvas, colour, (x, 1.6 * u + label.get_height() / 2), 0.7 * u)
            canvas.blit(label, (x + 1.4 * u, 1.6 * u))
            x += max(label.get_width(), 12 * u) + 4 * u
