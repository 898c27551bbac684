"""What an environment's spec says, of one that Gymnasium has just made."""

from __future__ import annotations

from dataclasses import replace

from gymnasium.envs.registration import EnvSpec

from .task import Task, plain_data


class Specified:
    """An environment whose spec tells the control periods of an episode, in arguments that JSON can hold."""

    task: Task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What :func:`gymnasium.make` or :func:`gymnasium.make_vec` was asked for, and how long an episode is."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            spec = replace(spec, max_episode_steps=self.task.steps, kwargs=plain_data(spec.kwargs))
        self._spec = spec
