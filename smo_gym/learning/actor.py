"""An actor that is at rest where the plant should be, for Stable-Baselines3."""

from __future__ import annotations

try:
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.type_aliases import Schedule
    from torch import Tensor, nn
except ImportError as error:
    raise ImportError('learning needs Stable-Baselines3: pip install "smo_gym[rl]"') from error


class Anchored(nn.Module):
    """net(o) - net(0)."""

    def __init__(self, net: nn.Sequential) -> None:
        super().__init__()
        self.net = net

    def forward(self, observation: Tensor) -> Tensor:
        """The features of observations, less those of the origin."""
        return self.net(observation) - self.net(observation.new_zeros(1, observation.shape[-1]))  # type: ignore[no-any-return]


class AnchoredPolicy(ActorCriticPolicy):
    """``MlpPolicy`` whose mean action is u(o) = f(o) - f(0), so that u(0) = 0.

    The origin is an equilibrium of the plant without a force, and of every such policy with it. PPO's noise misses it
    otherwise, where errors are small and cost little, by a decimetre. The critic is as usual.
    """

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        self.mlp_extractor.policy_net = Anchored(self.mlp_extractor.policy_net)  # type: ignore[assignment]
        self.action_net.bias.requires_grad_(False)  # it would cancel, and is zero from the beginning
