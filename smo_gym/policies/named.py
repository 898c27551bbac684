"""Agents by name: the shipped policy, trained weights, a model of Stable-Baselines3, a class of your own."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, cast

from numba.core.dispatcher import Dispatcher

from ..controllers import Agent
from ..validation import choice, unknown
from .frozen import MlpPolicy

SHIPPED = "ppo"
BASELINES = {"SMOPendulum-v0": "pendulum", "SMOPendulumUpright-v0": "upright"}
"""Environments with a shipped policy, and its file."""


def named(text: str) -> bool:
    """Whether a text has the form of an agent's name for :func:`load`."""
    return text == SHIPPED or text.endswith((".safetensors", ".zip")) or ":" in text


def is_data(name: str) -> bool:
    """Whether an agent is data alone: to load it runs no code, so that a file may name it."""
    return name == SHIPPED or name.endswith(".safetensors")


def load(name: str, environment: str) -> Agent:
    """An agent for an environment.

    Args:
        name: ``ppo``, the policy that comes with the package; ``PATH.safetensors``, weights with their card
            ``PATH.json``; ``PATH.zip``, a model that Stable-Baselines3 saved, which unpickles (only open files of those
            you trust); ``module:Class``, called without arguments.
        environment: id of the environment that it is to act in.

    Raises:
        ValueError: there is no such agent, its files are damaged, or it was trained for another environment.
        ImportError: an SB3 model, and the extra ``rl`` is missing.
    """
    if name == SHIPPED:
        if environment not in BASELINES:
            raise ValueError(f"no policy is shipped for {environment}, only for {' and '.join(BASELINES)}")
        return shipped(environment)
    if name.endswith(".safetensors"):
        policy = MlpPolicy.load(name)
        if policy.card.environment != environment:
            raise ValueError(f"{name}: was trained for {policy.card.environment}, not for {environment}")
        return policy
    if name.endswith(".zip"):
        from . import sb3_zip

        return sb3_zip.load(name)
    return _own(name)


def shipped(environment: str) -> MlpPolicy:
    """The policy on SMO estimates that comes with the package, as ``python agents/train.py`` trains it.

    Raises:
        ValueError: there is none for that environment.
    """
    name = BASELINES[choice("environment with a shipped policy", environment, BASELINES)]
    return MlpPolicy.load(Path(__file__).parent / "baselines" / f"{name}.safetensors")


def imported(name: str) -> ModuleType:
    """A user's module.

    Raises:
        ValueError: whatever it raises.
    """
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise ValueError(f"cannot import {name!r} ({type(error).__name__}: {error})") from error


def own(name: str, what: str = "function") -> Any:
    """What ``module:name`` names in a user's module, a class or a function.

    Raises:
        ValueError: there is none.
    """
    module_name, _, attribute = name.partition(":")
    try:
        module = imported(module_name)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    found = getattr(module, attribute, None)
    if not callable(found):
        kinds = type if what == "class" else (FunctionType, Dispatcher)
        known = [word for word, value in vars(module).items() if isinstance(value, kinds) and not word.startswith("_")]
        raise ValueError(unknown(f"{what} in {module_name}", attribute, known))
    return found


def _own(name: str) -> Agent:
    made = own(name, "class")
    try:
        agent = made()
    except (Exception, SystemExit) as error:
        raise ValueError(f"{name}: cannot be made without arguments ({type(error).__name__}: {error})") from error
    if not callable(getattr(agent, "predict", None)):
        raise ValueError(f"{name}: has no method predict(observation, state, episode_start, deterministic)")
    return cast(Agent, agent)
