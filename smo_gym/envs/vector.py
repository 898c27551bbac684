"""The environments natively vectorised: one compiled batch, one plant, generator and clock a slot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gymnasium import logger
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..loop import Part
from ..plant import PARAMS
from ..typing import Array, Flags
from ..validation import mapping, short, whole
from .desired import Desired
from .hearing import Heard, Hearing, held
from .pendulum import RESET_OPTIONS, PendulumEnv, TrackingEnv, UprightEnv
from .rendering import Renderer, Scene
from .resetting import instants, marked, seeds_of, slot_by_slot
from .spec import Specified
from .stepping import begin, checked_force, complain, loop_of
from .task import Task


class PendulumVectorEnv(Specified, VectorEnv[Array, Array, Array]):
    """``num_envs`` pendulums in one batch.

    Slot i seeded with s gives, bit for bit, what the scalar environment seeded with s + i gives, whatever the number
    of slots and threads. Options are those of :class:`~smo_gym.envs.pendulum.PendulumEnv`.

    With ``autoreset_mode=DISABLED`` an ended slot holds still (state unchanged, reward 0, its flags stay) until
    ``reset(options={"reset_mask": mask})`` starts it anew. The action of an ended slot is ignored in every mode.

    Args:
        num_envs: number of slots.
        render_mode: None, or "rgb_array": ``render()`` gives one frame a slot.
        max_episode_steps: control periods in an episode, where fewer than the horizon has.
        autoreset_mode: "NextStep" (default), "SameStep" or "Disabled", or the enumeration's member.
        **options: of the task.

    Raises:
        ValueError: an option is unknown or its value is not allowed; actions of another shape or not finite.
        gymnasium.error.ResetNeeded: `step` before `reset`.
    """

    scalar: ClassVar[type[PendulumEnv]] = PendulumEnv

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode={render_mode!r} must be None or 'rgb_array': a batch has no window")
        self.num_envs = num_envs = whole("num_envs", num_envs, 1)
        self.render_mode = render_mode
        self.task = Task.of(options, self.scalar.defaults)
        if max_episode_steps is not None:
            steps = min(whole("max_episode_steps", max_episode_steps, 1), self.task.steps)
            self.task = replace(self.task, horizon=steps * self.task.control_period)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise ValueError(f"autoreset_mode={short(autoreset_mode)} must be one of {modes}") from None
        self.metadata = {**self.scalar.metadata, "render_modes": ["rgb_array"], "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = self.task.observation_space
        self.single_action_space = self.task.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.loop = loop_of(self.task, num_envs)
        self._hearing, self._unit = Hearing(self.task), self.task.actuator.unit
        self._desired = None if self.task.reference is None else Desired(self.task, self.task.reference)
        self._renderer: Renderer | None = None  # made with the first frame, which alone needs pygame
        self._force = np.zeros(num_envs)
        self._ghosts: Array | None = None
        self._generators: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._k = np.zeros(num_envs, dtype=np.int64)  # the control instant that each slot is at
        self._cut = np.full(num_envs, self.task.steps)  # and the one that ends its episode
        self._terminated = np.zeros(num_envs, dtype=np.bool_)
        self._truncated = np.zeros(num_envs, dtype=np.bool_)
        self._waiting = False  # whether a slot may have ended
        self._everywhere = np.ones(num_envs, dtype=np.bool_)
        self._everywhere.flags.writeable = False  # infos share it

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """One generator a slot."""
        return tuple(self._generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """One seed a slot."""
        return tuple(self._seeds)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start all slots, or those of ``options["reset_mask"]``.

        Args:
            seed: an integer s seeds slot i with s + i; a sequence gives each slot its own.
            options: ``state`` (4,) or (n, 4), ``params`` (4,), (n, 4) or a mapping, ``reset_mask`` (n,) of bool,
                ``noise``, whole numbers () or (n,), ``steps``, whole numbers () or (n,): the control periods after
                which this one episode is truncated, at most those of the horizon, so that slots need not end together.
                Later episodes have the horizon.
        """
        options = mapping("reset option", options or {}, (*RESET_OPTIONS, "reset_mask", "steps"))
        mask = marked(options.pop("reset_mask", self._everywhere), self.num_envs)
        if not self._generators and not mask.all():
            raise ResetNeeded("no episode has begun: the first reset() must be of all slots")
        cut = instants(options.pop("steps", self.task.steps), self.num_envs, self.task.steps)
        asked = [self.task.asked(of_slot) for of_slot in slot_by_slot(options, self.num_envs)]
        self._seed(seed, mask)
        self._start(mask, asked)
        self._cut[mask] = cut[mask]
        return self._observation(), self._info(self._hearing.still(self.loop))

    def step(self, actions: Array) -> tuple[Array, Array, Flags, Flags, dict[str, Any]]:  # type: ignore[override]
        """Hold one force a slot over one control period."""
        if not self._generators:
            raise ResetNeeded("no episode has begun: call reset() before step()")
        loop, over = self.loop, None
        if self._waiting:
            over = self._terminated | self._truncated
            loop.alive[over] = 0.0
        loop.u[:] = checked_force(actions, self.num_envs, over)
        if self._unit != 1.0:
            loop.u *= self._unit
        self._k += 1 if over is None else ~over
        if self._desired is not None:
            loop.x_d[:] = self._desired.states[self._k].T
        heard = self._hearing.drive(loop)
        reward, terminated = loop.reward.copy(), loop.failed > 0.0
        truncated = (self._k == self._cut) & ~terminated
        if over is not None:
            if self.autoreset_mode is AutoresetMode.DISABLED:
                terminated[over], truncated[over] = self._terminated[over], self._truncated[over]
            else:  # the step after the end is the reset (NEXT_STEP)
                terminated[over] = truncated[over] = False
                self._start(over, [])
            heard = held(heard, loop, over)
        self._terminated, self._truncated = terminated.copy(), truncated.copy()
        info = self._info(heard)
        ended = terminated | truncated
        self._waiting = bool(np.count_nonzero(ended))
        if self._waiting:
            complain(loop, terminated if over is None else terminated & ~over)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._waiting:
            info = self._restart(ended, heard, info)
        return self._observation(), reward, terminated, truncated, info

    def _restart(self, ended: Flags, heard: Heard, final: dict[str, Any]) -> dict[str, Any]:
        """Start ended slots in the step that ended them (SAME_STEP): the last they gave goes to ``final_*``."""
        observation = self._observation()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final_obs[i] = observation[i].copy()
        final_info = {key: only(value, ended) for key, value in final.items()}
        self._start(ended, [])
        return {
            **self._info(held(heard, self.loop, ended)),
            "final_obs": final_obs,
            "_final_obs": ended.copy(),
            "final_info": final_info,
            "_final_info": ended.copy(),
        }

    def render(self) -> tuple[Any, ...] | None:
        """One frame (height, width, 3) a slot, as Gymnasium's vector environments give them; None without a mode."""
        if self.render_mode is None:
            logger.warn('render() needs a render mode: gymnasium.make_vec(..., render_mode="rgb_array")')
            return None
        if not self._generators:
            raise ResetNeeded("no episode has begun: call reset() before render()")
        if self._renderer is None:
            self._renderer = Renderer(self.render_mode, self.task)
        x_d = [None] * self.num_envs if self._desired is None else self._desired.states[self._k]
        return tuple(
            self._renderer.draw(
                Scene(
                    k * self.task.control_period,
                    self.loop.x[:, i].copy(),
                    self._params_told[i, 2],
                    self._force[i],
                    x_d[i],
                    None if self.task.sensor.exact else self.loop.y[:, i].copy(),
                ),
                None if self._ghosts is None else self._ghosts[:, i],
            )
            for i, k in enumerate(self._k.tolist())
        )

    def show(self, ghosts: Array) -> None:
        """Draw estimates (4, n) beside the states; whoever estimates calls it after each estimate."""
        if self.render_mode is not None:
            self._ghosts = ghosts.copy()

    def plug(self, observer: Part | Sequence[Part]) -> None:
        """Let an observer work inside of the loop; whoever plugs it starts it, too."""
        self.loop = self.loop.with_parts(observer=observer)

    def hold(self, slots: Flags) -> None:
        """End the episodes of the marked slots, (n,), here: where nothing restarts them they hold still."""
        self._truncated |= slots & ~self._terminated
        self._waiting = True

    def _seed(self, seed: int | Sequence[int | None] | None, mask: Flags) -> None:
        n, seeds = self.num_envs, seeds_of(seed, self.num_envs)
        fresh = not self._generators
        drawn = [seeding.np_random(s) if fresh or (s is not None and mask[i]) else None for i, s in enumerate(seeds)]
        kept = [None] * n if fresh else list(zip(self._generators, self._seeds, strict=True))
        pairs = [new or old for new, old in zip(drawn, kept, strict=True)]
        self._generators, self._seeds = [pair[0] for pair in pairs if pair], [pair[1] for pair in pairs if pair]

    def _start(self, mask: Flags, asked: Sequence[dict[str, Any]]) -> None:
        slots = np.flatnonzero(mask)
        cases = [replace(self.task.draw(self._generators[i]), **(asked[i] if asked else {})) for i in slots.tolist()]
        begin(self.loop, self.task, slots, cases)
        self._params_told = self.loop.own("plant")[PARAMS : PARAMS + 4].T.copy()
        self._params_told.flags.writeable = False  # infos share it
        self._k[mask], self._cut[mask] = 0, self.task.steps
        self._terminated[mask] = self._truncated[mask] = False

    def _observation(self) -> Array:
        if self._desired is None:
            return self.loop.y.T.copy()
        told = self._desired.told[self._k]
        observation = np.empty((self.num_envs, 2 + told.shape[1]))
        observation[:, :2] = self.loop.y.T
        observation[:, 2:] = told
        return observation

    def _info(self, heard: Heard) -> dict[str, Any]:
        positions, samples, asked, force, more = heard
        everywhere, self._force = self._everywhere, force.copy()
        info = {
            "state": self.loop.x.T.copy(),
            "_state": everywhere,
            "params": self._params_told,
            "_params": everywhere,
            "asked": asked.copy(),
            "_asked": everywhere,
            "force": self._force,
            "_force": everywhere,
            "positions": positions.transpose(2, 0, 1),
            "_positions": everywhere,
            "samples": samples.transpose(2, 0, 1),
            "_samples": everywhere,
        }
        for name, values in more.items():
            info |= {name: np.moveaxis(values, -1, 0), f"_{name}": everywhere}
        if self._desired is not None:
            info |= {"desired": self._desired.positions[self._k], "_desired": everywhere}
        return info


def only(values: NDArray[Any], slots: Flags) -> NDArray[Any]:
    """The values of some slots, zero (False) elsewhere, as Gymnasium's own vector environments give them."""
    some = np.zeros_like(values)
    some[slots] = values[slots]
    return some


class UprightVectorEnv(PendulumVectorEnv):
    """The vector form of ``SMOPendulumUpright-v0``."""

    scalar = UprightEnv


class TrackingVectorEnv(PendulumVectorEnv):
    """The vector form of ``SMOPendulumTracking-v0``."""

    scalar = TrackingEnv
