"""What every law, policy and agent answers to."""

from typing import Protocol

from ..typing import Array, Flags


class Agent(Protocol):
    """Anything with Stable-Baselines3's ``predict``, on batches: LQR, SMC, a learned policy, your own."""

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = False,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """Actions (n, action) for observations (n, observation), and the agent's own state for the next call."""
        ...


def title(agent: Agent) -> str:
    """An agent in messages, ``module:Class``."""
    return f"{type(agent).__module__}:{type(agent).__qualname__}"
