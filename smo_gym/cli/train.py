"""Train a policy with PPO on what an agent can know, on plants drawn anew for every episode.

    smo-gym train --env SMOPendulum-v0 --observation smo

Writes a checkpoint to --out every twentieth of the way, from which the same command resumes, and with more --steps goes
on from a finished training; at the end the policy, policy.safetensors, and a card of what it is, where it comes from
and what it was measured to do, policy.json.
"""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from tabulate import tabulate
from tqdm import tqdm

from .. import files
from ..evaluation import configs
from ..wrappers.view import KINDS
from . import between, narrow, starting
from .arguments import Parser, fraction, versions, whole
from .entry import Stop, command, typed

DEFAULTS = {"ppo": "ppo", "recurrent": "ppo_lstm"}
"""Hyperparameters of each algorithm, by the name of their file."""
COLUMNS = {
    "steps": "steps",
    "return": "return",
    "standing": "standing, s",
    "failed": "failed",
    "mse_h": "MSE of h",
    "mse_theta": "MSE of theta",
}
"""What is shown of each checkpoint: the key in the curve, and above its column."""
PACKAGES = ("smo_gym", "gymnasium", "numpy", "stable-baselines3", "sb3-contrib", "torch")


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = Parser("train", __doc__)
    add = parser.add_argument
    add("--env", default="SMOPendulum-v0", help="an environment of --config (default SMOPendulum-v0)")
    add("--observation", help=f"{', '.join(KINDS)} (default: that of --config)")
    add("--algo", choices=DEFAULTS, default="ppo", help="ppo (default), or recurrent: an LSTM on positions alone")
    parser.seed("weights, exploration and plants")
    add("--steps", type=whole(1), metavar="N", help="control periods to learn from (default: those of --config)")
    add("--uncertainty", type=fraction, metavar="X", help="level of the plants, a fraction (default: that of --config)")
    between.add(parser)
    add("--config", type=Path, metavar="FILE", help="hyperparameters (default: configs/ppo.yaml or ppo_lstm.yaml)")
    add("--out", type=Path, metavar="DIR", help="default: runs/ENV-OBSERVATION-ALGO-SEED")
    add("--tensorboard", action="store_true", help="write what TensorBoard shows, to DIR/tensorboard")
    args = parser.parse_args(arguments)
    args.config = args.config or configs.path(DEFAULTS[args.algo])
    return args


@command("train")
def main(arguments: Sequence[str] | None = None) -> int:
    """Train; 0 when all went well, 2 for a bad argument or setting, 130 when interrupted."""
    args, out = parse(arguments), None
    try:
        from ..learning import measurement, settings, training

        of_policy = (args.env, args.algo, args.observation, args.seed, args.steps)
        run = settings.load(args.config, *of_policy, args.uncertainty, between.data(args))
        name = f"{run.environment}-{run.observation}-{run.algorithm}-{run.seed}"
        with files.claimed(args.out or Path("runs") / name, ["policy.safetensors", "policy.json"]) as out:
            with tqdm(total=run.steps, unit="step", unit_scale=True, desc="learning", disable=None) as bar:

                def show(steps: int, found: dict[str, float]) -> None:
                    bar.update(min(steps, run.steps) - bar.n)
                    bar.set_postfix(
                        {key: f"{found[key]:.4g}" for key in ("return", "standing", "failed") if key in found}
                    )

                policy = training.train(run, out, show, args.tensorboard)
            told = {"command": typed("train", arguments), "versions": versions(PACKAGES)}
            card = policy.card.model_copy(update=told)
            replace(policy, card=card).save(out / "policy.safetensors")
    except KeyboardInterrupt:
        where = f"; the same command resumes from the last checkpoint in {out}" if out else " before it began"
        raise Stop(f"interrupted{where}") from None
    curve = [[point.get(column, math.nan) for column in COLUMNS] for point in policy.card.curve]
    measured = policy.card.measured
    print(f"While learning, on {measured['runs']} plants that learning does not see:\n")
    print(tabulate(curve, list(COLUMNS.values()), floatfmt=".4g"))
    print("\n" + narrow.paragraph(f"The best of them, on others: {in_words(measured)}"))
    beside = measurement.measure_lqr(policy.card, int(measured["runs"]))
    if beside is not None:
        print(narrow.paragraph(f"LQR on the same plants, on SMO estimates, as often: {in_words(beside)}"))
    print(f"The policy is {out / 'policy.safetensors'}. To watch it:\n")
    print(f"    {starting.line('watch')} {shlex.quote(str(out))}")
    return 0


def in_words(measured: Mapping[str, float]) -> str:
    """What a policy was measured to do, as a sentence."""
    failed, runs, seconds = measured["failed"], measured["runs"], f"{measured['standing']:.3g} s"
    stood = (
        f"{failed} of {runs} runs failed; they stood {seconds} on average"
        if failed
        else f"none of {runs} runs failed in {seconds}"
    )
    errors = (
        f"; MSE of h {measured['mse_h']:.3g} m^2, of theta {measured['mse_theta']:.3g} rad^2" if failed < runs else ""
    )
    return f"{stood}; return {measured['return']:.4g}{errors}."
