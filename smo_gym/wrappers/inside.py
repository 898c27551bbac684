"""What an observer stands on: which observer, around which environment, and how it is at work there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv, VectorObservationWrapper, VectorWrapper

from ..envs.pendulum import PendulumEnv
from ..envs.task import Task, plain_data
from ..envs.vector import PendulumVectorEnv
from ..kernels.blocks import XHAT, Y
from ..loop import Loop, Part
from ..observers import OBSERVERS, Estimator, Observer, Oracle, SlidingModeObserver, start_each
from ..observers.estimator import parts_of
from ..typing import Array, Flags
from ..validation import choice, short, unknown

# A force without limit bounds nothing: the step is then checked for the largest that the article's runs reach.
_USUAL_FORCE = 30.0


def make_observer(observer: str | Observer, compensation: bool | None, settings: dict[str, Any]) -> Observer:
    """An observer by name and settings, or the object itself, which has its own.

    Raises:
        TypeError: neither a name nor an observer.
        ValueError: an unknown name or setting, or settings beside an object.
    """
    if not isinstance(observer, str):
        if not hasattr(observer, "start"):
            raise TypeError(f"observer={observer!r} must be one of {', '.join(map(repr, OBSERVERS))} or an Observer")
        if settings or compensation is not None:
            given = [*settings, *["compensation"] * (compensation is not None)]
            raise ValueError(f"{', '.join(given)} must not be given beside {observer!r}, which has its own settings")
        return observer
    cls = OBSERVERS[choice("observer", observer, OBSERVERS)]
    known = {field.name for field in fields(cls)}
    for name in settings:
        if name not in known:
            raise ValueError(unknown(f"setting of the observer {observer!r}", name, known))
    if "compensation" in known and compensation is not None:
        settings = {"compensation": compensation, **settings}
    return cast(Observer, cls(**settings))


def named(observer: Any, compensation: bool | None, settings: dict[str, Any]) -> dict[str, Any]:
    """The constructor's arguments as plain data, so that a spec survives JSON."""
    if isinstance(observer, SlidingModeObserver):
        return {"observer": "smo", **plain_data(observer.as_dict())}
    if isinstance(observer, Oracle):
        return {"observer": "oracle"}
    return {"observer": observer, "compensation": compensation, **plain_data(settings)}


UNSEEN = (
    "an observer reads what the encoders measured, info['samples'], and would not see this. Noise, quantisation or "
    "delay of a sensor are the environment's option 'sensor', or of a wrapper inside that changes info['samples'] and "
    "the observation alike; a change that is meant for the agent alone belongs outside the observer"
)


def task_of(env: Any, batch: bool | None = None) -> Task:
    """The task of an environment that observes what its task tells and no more.

    Args:
        env: the environment, scalar or vector.
        batch: whether it must be the one or the other.

    Raises:
        TypeError: the environment is not one of this package, or scalar where a vector is wanted, or the reverse.
        ValueError: its slots have different tasks, or something changes what it observes.
    """
    if not isinstance(env, gymnasium.Env | VectorEnv):
        raise TypeError(f"env={short(env)} must be a smo_gym environment, as gymnasium.make or make_vec gives it")
    if batch is not None and batch != isinstance(env, VectorEnv):
        kind = "VectorObserverWrapper (or VectorAgentView)" if not batch else "ObserverWrapper (or agent_view)"
        raise TypeError(f"{env} is {'one environment' if batch else 'a batch'}: wrap it in {kind}")
    layer: Any = env
    while isinstance(layer, gymnasium.Wrapper | VectorWrapper):
        if isinstance(layer, gymnasium.ObservationWrapper | VectorObservationWrapper):
            raise ValueError(f"{layer} changes the observation: {UNSEEN}")
        layer = layer.env
    base = env.unwrapped
    many = isinstance(base, SyncVectorEnv | AsyncVectorEnv)
    try:
        task, *others = base.get_attr("task") if many else [base.task]  # type: ignore[union-attr]
    except AttributeError:
        task, others = None, []
    if not isinstance(task, Task):
        raise TypeError(f"{env} is not a smo_gym environment: an observer needs its sampling period and samples")
    if any(other != task for other in others):
        raise ValueError(f"{env} has environments with different options: one wrapper serves alike ones")
    space = env.single_observation_space if isinstance(env, VectorEnv) else env.observation_space
    if space.shape != task.observation_space.shape:
        raise ValueError(f"{env} observes {space}: an observer or view must stand inside whatever else changes that")
    return task


def unseen(observation: Array, y: Array) -> ValueError:
    """What there is to say where the observation is not what the encoders measured."""
    return ValueError(f"the environment observes {short(observation)} where {short(y)} was measured: {UNSEEN}")


def bring(estimator: Estimator, samples: Array, told: Array) -> None:
    """Bring estimates to the end of a control period.

    Args:
        estimator: of n slots.
        samples: measured positions, (samples, 2, n).
        told: the force in N, (n,), or where it is measured, too, that of each sampling period, (samples, n).
    """
    if told.ndim == 1:
        estimator.update(samples, told)
    else:
        for k, u in enumerate(told):
            estimator.update(samples[k : k + 1], np.ascontiguousarray(u))


def lost_of(xhat: Array) -> Flags | None:
    """Which estimates (4, n) are not finite, (n,); None where all are."""
    finite = np.isfinite(xhat)
    return None if np.count_nonzero(finite) == finite.size else np.asarray(~finite.all(axis=0))


def space_of(inner: spaces.Space[Any]) -> spaces.Space[Array]:
    """The space of observations to which an estimate is appended."""
    assert isinstance(inner, spaces.Box)
    return spaces.Box(-np.inf, np.inf, (*inner.shape[:-1], inner.shape[-1] + 4), np.float64)


def as_they_are(it: Any, kind: type) -> bool:
    """Whether an object is of a kind, and its class has left ``step`` and ``reset`` alone."""
    return isinstance(it, kind) and all(getattr(type(it), name) is vars(kind)[name] for name in ("step", "reset"))


def at_work(env: Any, observers: Sequence[Observer]) -> Estimator:
    """Observers, one a slot, at work on an environment: inside of its loop where they are compiled and it has one.

    A wrapper of the user's own between the two may change what the encoders measured, in the observation and
    ``info["samples"]`` alike; what stands in the loop would not see it.

    Raises:
        ValueError: an observer cannot work with this environment.
    """
    task = task_of(env)
    force = task.force_limit if np.isfinite(task.force_limit) else _USUAL_FORCE
    plant = (task.dt, force, task.params)
    layer, ours = env, True
    while isinstance(layer, gymnasium.Wrapper | VectorWrapper):
        ours &= type(layer).__module__.startswith("gymnasium.")
        layer = layer.env
    ours &= as_they_are(layer, PendulumEnv) or as_they_are(layer, PendulumVectorEnv)
    if ours:
        parts = parts_of(observers, *plant)
        if parts is not None:
            sees = any(isinstance(observer, Oracle) for observer in observers)
            return Oracular(layer, parts, observers) if sees else Plugged(layer, parts)
    return start_each(observers, *plant)


class Plugged:
    """Observers that work inside of an environment's loop: stepping it has updated them.

    There is room for the observers of one wrapper: another one around the same environment, once it is reset, takes it.
    """

    def __init__(self, env: PendulumEnv | PendulumVectorEnv, parts: Sequence[Part]) -> None:
        self._env, self._parts = env, parts
        self._plug()

    def _plug(self) -> None:
        self._env.plug(self._parts)
        self.loop: Loop = self._env.loop

    @property
    def xhat(self) -> Array:
        """The estimates (4, n), a copy.

        Raises:
            gymnasium.error.ResetNeeded: another wrapper's observers work in the environment since.
        """
        return self.observed[2:]

    @property
    def observed(self) -> Array:
        """Measurements and estimates, (6, n), a copy.

        Raises:
            gymnasium.error.ResetNeeded: as :attr:`xhat`.
        """
        if self._env.loop is not self.loop:
            raise ResetNeeded("another observer was put around this environment: call reset() of this one's wrapper")
        return self.loop.rows[Y : XHAT + 4].copy()

    def reset(self, slots: Flags, y: Array) -> None:
        """Start the marked slots anew, where the loop's encoders are."""
        if self._env.loop is not self.loop:
            if not slots.all():
                raise ResetNeeded("another observer was put around this environment: call reset() of all slots")
            self._plug()
        self.loop.restart("observer", slots)

    def update(self, samples: Array, u: Array) -> None:
        """Nothing is left to do."""


class Oracular(Plugged):
    """Some of the observers see the truth: at a reset, too, which the loop's blocks do not."""

    def __init__(
        self, env: PendulumEnv | PendulumVectorEnv, parts: Sequence[Part], observers: Sequence[Observer]
    ) -> None:
        super().__init__(env, parts)
        self._oracles = np.array([isinstance(observer, Oracle) for observer in observers])

    def see(self, slots: Flags, x: Array) -> None:
        """Show the states of the marked slots."""
        seen = slots & self._oracles
        self.loop.xhat[:, seen] = x[:, seen]
