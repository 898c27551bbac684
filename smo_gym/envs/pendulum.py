"""``SMOPendulum-v0`` and ``SMOPendulumUpright-v0``, one plant at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import logger
from gymnasium.error import ResetNeeded

from ..loop import Part
from ..typing import Array
from ..validation import mapping, short
from .desired import Desired
from .hearing import Heard, Hearing
from .rendering import MODES, Renderer, Scene
from .spec import Specified
from .stepping import begin, complain, loop_of
from .task import HANGING, TRACKING, UPRIGHT, Task

RESET_OPTIONS = ("state", "params", "noise")
_ALL = slice(None)


class PendulumEnv(Specified, gymnasium.Env[Array, Array]):
    """A cart pendulum whose parameters are uncertain and of which only the positions are measured.

    ## Description

    A cart on a track carries a rod with a bob at its end; a force moves the cart. Every episode draws its own plant:
    cart mass, bob mass and rod length are each scaled by U(1 - x, 1 + x), and the agent is told none of it. Encoders
    measure where the cart and the rod are, not how fast they move. The goal is to bring both to rest at zero.

    `SMOPendulum-v0` is the article's plant, with its g = -9.8 m/s^2: theta = 0 is the *hanging* equilibrium.
    `SMOPendulumUpright-v0` has g = +9.8 m/s^2: theta = 0 is upright and unstable.

    ## Action Space

    `Box(-force_limit, force_limit, (1,), float64)`: the force on the cart in N. Forces beyond the limit are clipped, as
    a saturated actuator would.

    | Num | Action | Min | Max | Unit |
    |-----|--------|-----|-----|------|
    | 0 | force F on the cart | -30 | 30 | N |

    ## Observation Space

    `Box(-inf, inf, (2,), float64)`: the encoders. theta is not wrapped, as an encoder goes on counting.

    | Num | Observation | Min | Max | Unit |
    |-----|-------------|-----|-----|------|
    | 0 | cart position h | -inf | inf | m |
    | 1 | rod angle theta from the equilibrium | -inf | inf | rad |

    :class:`smo_gym.ObserverWrapper` appends an estimate of the whole state.

    ## Rewards

    `-control_period (q . x^2 + r F^2)` with q = (1, 1, 0.1, 0.1) on (h, theta, h', theta') and r = 0.001, x at the end
    of the control period; 100 less when the episode terminates. See :class:`~smo_gym.envs.task.Reward`.

    ## Starting State

    Drawn from the box `initial_state`: by default the one that the four cases of the article's Table 5 span, h and
    theta in [-1, 1], h' = 0.1, theta' = 0.01; upright, theta in [-0.2, 0.2] and the rest zero.

    ## Episode End

    Termination: the cart leaves the track (`|h| > track_limit`), the rod falls (`|theta| > angle_limit`; pi/2 upright,
    no limit hanging) or the state is not finite any more; the last finite one is then told. Truncation: after `horizon`
    seconds. Reaching the goal ends nothing.

    ## Information

    At every step, with the same keys: `state` (4,) and `params` [M_c, m, l, g] (4,), the truth; `asked`, the force in N
    that was asked for, within the limit, and `force`, what reached the cart of it, the mean over the control period;
    `samples` (substeps, 2), what the sensors measured at each sampling instant of the control period just run, and
    `positions` (substeps, 2), the truth then; with a reference also `desired` (substeps, 2), where h and theta should
    have been. Where there is friction, `friction` (3,); with a disturbance, `pushes` (substeps, 2), its force in N and
    torque in N m; with jitter, `stamps` (substeps,), how much later in s a sample was taken than it should; with a
    force that is measured, `forces` (substeps,).

    ## Sensors, Actuators, Friction, Disturbances

    By default, in all three environments, the encoders are exact, the force reaches the cart as it was asked for,
    nothing rubs and nothing else pushes: the article's setting. Each of the options `sensor`, `actuator`, `friction`
    and `disturbance` changes one of these; `smo-gym presets` lists names for them. Observation and `samples` are then
    what the sensors say, while `state`, `positions` and the end of an episode are of the truth; rewards weigh the true
    state and the force that was asked for. With an actuator's `unit` actions are in that unit.

    ## Arguments

    | Argument | Default | Meaning |
    |----------|---------|---------|
    | `control_period` | 0.02 | s; the force is held over it; a whole multiple of `dt` |
    | `dt` | 0.001 | s; Runge-Kutta step of the plant and sampling period of the encoders |
    | `params` | Table 2 | nominal plant, or a mapping of `cart_mass`, `bob_mass`, `rod_length`, `gravity` |
    | `uncertainty` | 0.1 | x in [0, 1) |
    | `initial_state` | see above | one state (4,) or a box (2, 4) of [low, high] |
    | `force_limit` | 30 | N; None for no limit |
    | `track_limit` | 5 | m; None for no limit |
    | `angle_limit` | None | rad; None for no limit |
    | `horizon` | 35 | s |
    | `reward` | see above | weights: a mapping with `q`, `r`, `failure` |
    | `reference` | None | a trajectory to follow, :class:`smo_gym.Reference`; None asks for rest at zero |
    | `preview` | 5 | number of future control instants whose x_d a tracking observation tells |
    | `sensor` | exact | :class:`~smo_gym.sensors.Sensor`, a mapping of its fields or a preset's name |
    | `actuator` | ideal | :class:`~smo_gym.actuators.Actuator`, a mapping of its fields or a preset's name |
    | `disturbance` | none | :class:`~smo_gym.disturbances.Disturbance`, a mapping, several of these, or a name |
    | `friction` | of `params` | the true plants' :class:`~smo_gym.friction.Friction`, a mapping or a name |
    | `friction_uncertainty` | 0 | x in [0, 1): each of its coefficients is scaled by U(1 - x, 1 + x) |
    | `render_mode` | None | `"human"`: a window; `"rgb_array"`: frames (400, 800, 3), no display needed |

    `reset(options={"state": ..., "params": ..., "noise": ...})` replays one exact case; what is not given is drawn.
    All else that is random in an episode (noise of the sensors, friction, disturbances) follows from the one whole
    number `noise` in [0, 2^52).

    ## Rendering

    With the extra `render` (pygame-ce). Cart, rod and bob as they are, of this episode's rod length; the force as an
    arrow, one and a half rods long at the limit (at 30 N without one); the reference in green; and under
    :class:`smo_gym.ObserverWrapper` the estimate as a ghost in blue, both with the same rod; where the sensor is not
    exact, crosses at what it says of cart and bob. The frame goes along with a cart that leaves its middle.
    `metadata["render_fps"]` is that of real time, one frame a control period.

    Raises:
        ValueError: an option is unknown or its value is not allowed; an action of another shape or not finite.
        gymnasium.error.ResetNeeded: `step` before `reset` or after the end of an episode; `render` before `reset`.
        ImportError: the first frame is to be drawn, but pygame-ce is missing.
        RuntimeError: the first frame of `"human"` is to be drawn, but there is no display.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": MODES, "render_fps": 50}  # type: ignore[misc]
    defaults: ClassVar[Task] = HANGING

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        if render_mode is not None and render_mode not in MODES:
            raise ValueError(f"render_mode={render_mode!r} must be None or one of {', '.join(map(repr, MODES))}")
        self.render_mode = render_mode
        self.task = Task.of(options, self.defaults)
        fps = max(round(1.0 / self.task.control_period), 1)
        self.metadata = {**self.metadata, "render_fps": fps}  # type: ignore[misc]
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space
        self.loop = loop_of(self.task, 1)
        self._hearing = Hearing(self.task)
        self._unit, self._steps = self.task.actuator.unit, self.task.steps
        self._desired = None if self.task.reference is None else Desired(self.task, self.task.reference)
        self._steps_left = 0
        self._renderer: Renderer | None = None  # made with the first frame, which alone needs pygame
        self._scene: Scene | None = None
        self._ghost: Array | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Draw a plant and an initial state, or take them from ``options``."""
        asked = self.task.asked(mapping("reset option", options or {}, RESET_OPTIONS))
        super().reset(seed=seed)
        case = replace(self.task.draw(self.np_random), **asked)
        begin(self.loop, self.task, _ALL, [case])
        if "observer" in self.loop.parts:
            self.loop.restart("observer", _ALL)
        self._params = case.params
        self._steps_left = self._steps
        self._see(0, 0.0)
        return self._observation(0), self._info(self._hearing.still(self.loop), 0)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold the force over one control period."""
        if self._steps_left == 0:
            raise ResetNeeded("the episode has not begun or is over: call reset() before step()")
        try:
            wanted = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError):
            raise ValueError(f"action={short(action)} must be an array of numbers of shape (1,)") from None
        if wanted.shape != (1,):
            raise ValueError(f"action={short(action)} has shape {wanted.shape}, it must have shape (1,)")
        force = wanted.item()
        if not math.isfinite(force):
            raise ValueError(f"action={force} (slot 0) must be finite")
        self._steps_left -= 1
        k = self._steps - self._steps_left
        loop = self.loop
        loop.u[0] = force * self._unit
        if self._desired is not None:
            loop.x_d[:, 0] = self._desired.states[k]
        heard = self._hearing.drive(loop)
        terminated = loop.failed.item() > 0.0
        truncated = self._steps_left == 0 and not terminated
        if terminated:
            self._steps_left = 0
            complain(loop, loop.failed > 0.0)
        info = self._info(heard, k)
        self._see(k, info["force"])
        return self._observation(k), loop.reward.item(), terminated, truncated, info

    def render(self) -> Any:
        """The frame of the mode: an array (height, width, 3) or, in a window, None."""
        if self.render_mode is None:
            logger.warn('render() needs a render mode: gymnasium.make(..., render_mode="rgb_array")')
            return None
        if self._scene is None:
            raise ResetNeeded("the episode has not begun: call reset() before render()")
        if self._renderer is None:
            self._renderer = Renderer(self.render_mode, self.task)
        return self._renderer.draw(self._scene, self._ghost)

    def show(self, ghost: Array) -> None:
        """Draw an estimate (4,) beside the state; whoever estimates calls it at once and after each estimate."""
        if self.render_mode is None:
            return
        self._ghost = ghost.copy()
        if self.render_mode == "human" and self._scene is not None:
            self.render()

    def plug(self, observer: Part | Sequence[Part]) -> None:
        """Let an observer work inside of the loop; whoever plugs it starts it, too."""
        self.loop = self.loop.with_parts(observer=observer)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()

    def _see(self, k: int, force: float) -> None:
        if self.render_mode is None:
            return
        x_d = None if self._desired is None else self._desired.states[k]
        y = None if self.task.sensor.exact else self.loop.y[:, 0].copy()
        self._scene = Scene(k * self.task.control_period, self.loop.x[:, 0].copy(), self._params[2], force, x_d, y)
        if self.render_mode == "human" and self._ghost is None:  # else once the ghost has moved, too
            self.render()

    def _observation(self, k: int) -> Array:
        y = self.loop.y[:, 0]
        return y.copy() if self._desired is None else np.concatenate([y, self._desired.told[k]])

    def _info(self, heard: Heard, k: int) -> dict[str, Any]:
        positions, samples, asked, force, more = heard
        info = {
            "state": self.loop.x[:, 0].copy(),
            "params": self._params.copy(),
            "asked": asked.item(),
            "force": force.item(),
            "positions": positions[:, :, 0],
            "samples": samples[:, :, 0],
        }
        if more:
            info |= {name: values[..., 0] for name, values in more.items()}
        if self._desired is not None:
            info["desired"] = self._desired.positions[k].copy()
        return info


class UprightEnv(PendulumEnv):
    """``SMOPendulumUpright-v0``: :class:`PendulumEnv` with g = +9.8 m/s^2, so that theta = 0 is unstable.

    It starts from ``|theta| <= 0.2`` at rest in the middle of the track and ends beyond ``|theta| = pi/2``.
    """

    defaults = UPRIGHT


class TrackingEnv(PendulumEnv):
    """``SMOPendulumTracking-v0``: :class:`PendulumEnv` that should follow the minimum-energy reference of Table 7.

    The observation is [h, theta], then x_d (4) now, then x_d at each of the next ``preview`` control instants. The
    reward weighs x - x_d. An episode begins on the reference and ends with it; ``horizon`` may be longer (then rest).
    """

    defaults = TRACKING
