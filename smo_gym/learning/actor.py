"""An actor with the plant's symmetry, for Stable-Baselines3."""

from __future__ import annotations

try:
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.type_aliases import Schedule
except ImportError as error:
    raise ImportError('learning needs Stable-Baselines3: pip install "smo_gym[rl]"') from error


class OddPolicy(ActorCriticPolicy):
    """``MlpPolicy`` whose actor has no biases, so that with tanh u(-o) = -u(o).

    Plant, observer and cost do not change when h, theta and u change sign together; nor should the law. It follows that
    u(0) = 0: the rest state is an equilibrium of every policy on the way, which PPO's noise otherwise misses by
    decimetres. The critic is as usual.
    """

    def _build(self, lr_schedule: Schedule) -> None:
        super()._build(lr_schedule)
        for layer in (*self.mlp_extractor.policy_net, self.action_net):
            if hasattr(layer, "bias"):
                layer.bias.data.zero_()
                layer.bias.requires_grad_(False)
