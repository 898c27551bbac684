"""What an environment's spec says, of one that Gymnasium has just made."""

from __future__ import annotations

from dataclasses import replace

from gymnasium.envs.registration import EnvSpec

from .task import Task, plain_data


def told(spec: EnvSpec | None, task: Task) -> EnvSpec | None:
    """The spec with the number of control periods of an episode, and arguments of plain data, which JSON can hold."""
    return None if spec is None else replace(spec, max_episode_steps=task.steps, kwargs=plain_data(spec.kwargs))
