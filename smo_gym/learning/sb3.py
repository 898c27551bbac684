"""A Gymnasium vector environment as Stable-Baselines3's ``VecEnv``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from ..typing import Array, Flags

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError('learning needs Stable-Baselines3: pip install "smo_gym[rl]"') from error

PER_SLOT = ("np_random", "np_random_seed")
"""Attributes of which a vector environment has one a slot; all others are the same for every slot."""


class SB3VecEnv(VecEnv):
    """One batch of plants where Stable-Baselines3 expects a list of environments.

    Only slots whose episode has just ended have something in their info: ``terminal_observation`` and
    ``TimeLimit.truncated``. The whole last info of the batch is in ``vector_info``.

    Args:
        env: a vector environment, such as :class:`~smo_gym.wrappers.view.VectorAgentView`, with
            ``autoreset_mode=SAME_STEP``, the way of Stable-Baselines3.

    Raises:
        ValueError: another autoreset mode.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        if env.metadata.get("autoreset_mode") is not AutoresetMode.SAME_STEP:
            raise ValueError("Stable-Baselines3 restarts in the same step: make it with autoreset_mode='SameStep'")
        self.env = env
        self.vector_info: dict[str, Any] = {}
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> NDArray[Any]:
        """Start all slots with the seeds and options that :meth:`seed` and :meth:`set_options` have left."""
        observation, self.vector_info = self.env.reset(seed=self._seeds, options=_together(self._options))  # type: ignore[arg-type]
        self._reset_seeds()
        self._reset_options()
        return observation  # type: ignore[no-any-return]

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[np.float32], Flags, list[dict[str, Any]]]:
        """Step all slots."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = np.logical_or(terminated, truncated)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done):
            infos[i]["terminal_observation"] = info["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        self.vector_info = info
        return observation, np.asarray(reward, dtype=np.float32), done, infos

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """The attribute of the nearest wrapper that has it, for each slot asked for."""
        value = getattr(self._owner(attr_name), attr_name)
        return [value[i] if attr_name in PER_SLOT else value for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Set an attribute of the batch.

        Raises:
            ValueError: only some slots are asked for.
        """
        self._all(f"set_attr({attr_name!r}", indices)
        setattr(self._owner(attr_name), attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method once, on the batch; what it returns stands for each slot.

        Raises:
            ValueError: only some slots are asked for.
        """
        self._all(f"env_method({method_name!r}", indices)
        return [getattr(self._owner(method_name), method_name)(*method_args, **method_kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None) -> list[bool]:
        """Whether a wrapper of that class is around the batch, for each slot asked for."""
        wrapped = any(isinstance(layer, wrapper_class) for layer in self._layers())
        return [wrapped for _ in self._get_indices(indices)]

    def _get_indices(self, indices: int | Iterable[int] | None) -> Iterable[int]:
        """The slots asked for; the base class takes NumPy's integers for lists."""
        return super()._get_indices(int(indices) if isinstance(indices, np.integer) else indices)

    def _all(self, call: str, indices: int | Iterable[int] | None) -> None:
        if sorted(self._get_indices(indices)) != list(range(self.num_envs)):
            raise ValueError(f"{call}, indices={indices!r}): the slots are one batch, name all {self.num_envs} or none")

    def _layers(self) -> list[Any]:
        """The environment and what is inside it."""
        layers: list[Any] = [self.env]
        while isinstance(layers[-1], VectorWrapper):
            layers.append(layers[-1].env)
        return layers

    def _owner(self, name: str) -> Any:
        """The outermost layer that has the attribute."""
        for layer in self._layers():
            if hasattr(layer, name):
                return layer
        raise AttributeError(f"{self.env} has no attribute {name!r}")


def _together(each: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Options of the batch from one mapping a slot: what is the same for all passes as it is, the rest is stacked."""
    if not any(each):
        return None
    if any(options.keys() != each[0].keys() for options in each):
        raise ValueError("reset options must name the same things for every slot")
    together = {}
    for name, first in each[0].items():
        values = [np.asarray(options[name]) for options in each]
        together[name] = first if all(np.array_equal(values[0], value) for value in values) else np.stack(values)
    return together


def layers(policy: Any) -> list[tuple[Array, Array]]:
    """Weights and biases, inputs first, of an actor whose hidden layers are dense with tanh.

    Raises:
        ValueError: the actor has layers of another kind, or squashes what comes out of them.
    """
    if policy.squash_output:
        raise ValueError("squash_output=True: a frozen policy clips its output, it does not squash it")
    hidden = list(policy.mlp_extractor.policy_net)
    dense, between = [*hidden[::2], policy.action_net], hidden[1::2]
    if any(type(layer).__name__ != "Linear" for layer in dense) or any(type(f).__name__ != "Tanh" for f in between):
        raise ValueError(f"policy has the layers {hidden}, they must be dense with tanh between them")
    return [(_array(layer.weight), _array(layer.bias)) for layer in dense]


def lstm_weights(lstm: Any) -> tuple[Array, ...]:
    """Weights and biases of a single LSTM layer: of its inputs, of its own output.

    Raises:
        ValueError: there are several layers.
    """
    if lstm.num_layers != 1:
        raise ValueError(f"lstm has {lstm.num_layers} layers, it must have 1")
    parts = (lstm.weight_ih_l0, lstm.weight_hh_l0, lstm.bias_ih_l0, lstm.bias_hh_l0)
    return tuple(_array(part) for part in parts)


def _array(parameter: Any) -> Array:
    return parameter.detach().numpy().astype(np.float64)  # type: ignore[no-any-return]
