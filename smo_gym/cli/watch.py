"""Watch one run: a controller on a plant, and the observer's estimate as a ghost, in a window or as a file.

    smo-gym watch smc --env SMOPendulumTracking-v0 --out run.gif

Limits of force, track and angle are those of the environment.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from .. import ObserverWrapper, files
from ..controllers import Agent
from ..envs.rendering import closed_by_user
from ..envs.task import Task
from ..evaluation import configs, scenario
from ..evaluation.arms import ARMS, ORACLE, PRINTED, SMO
from ..evaluation.scenario import Scenario
from ..learning.contest import ARM_OF
from ..policies import named
from ..policies.frozen import MlpPolicy
from ..typing import Array
from ..validation import choice, number, unknown
from . import recording, starting
from .arguments import Parser, fraction, one_of, real
from .entry import command

COMPENSATION = dict(zip(("off", "on"), PRINTED, strict=True))
TRAINED = "policy.safetensors"


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = Parser("watch", __doc__)
    add = parser.add_argument
    add(
        "controller",
        nargs="?",
        default="lqr",
        metavar="CONTROLLER",
        help="lqr (default) or smc; the folder of a training; ppo for the policy that comes with the package; "
        "PATH.safetensors for a trained one; PATH.zip for a model of Stable-Baselines3 (loading one can run code); "
        "module:Class for an agent of your own",
    )
    known = tuple(configs.OF_ENVIRONMENT)
    add("--env", type=one_of("environment", known), help=f"{', '.join(known)} (default: the policy's, else the first)")
    add("--state", type=real, nargs=4, metavar=("H", "THETA", "H_DOT", "THETA_DOT"), help="start, in m, rad and s")
    add(
        "--case", metavar="N", help="start: the Nth initial state of the environment's scenario (default 1; of Table 5)"
    )
    add("--uncertainty", type=fraction, metavar="X", help="level of the random plant, a fraction (default 0.1)")
    add("--params", nargs="+", default=[], metavar="NAME=X", help="a plant that is not random, such as rod_length=0.6")
    parser.seed("the random plant")
    told = f"{SMO} or another arm: {', '.join(name for name in ARMS if name not in PRINTED)} (default: the policy's)"
    add("--observer", type=one_of("observer", (SMO, *(name for name in ARMS if name not in PRINTED))), help=told)
    add("--compensation", type=one_of("compensation", (*COMPENSATION, ORACLE)), help="on (default) or off; or oracle")
    add("--seconds", type=real, default=10.0, help="length of the run (default 10)")
    add("--out", type=Path, metavar="FILE", help=".gif, .webp or .mp4, in place of a window")
    return parser.parse_args(arguments)


@command("watch")
def main(arguments: Sequence[str] | None = None) -> int:
    """Show or write the run; 0 when all went well, 2 for a bad argument or a missing extra, 130 when interrupted."""
    args = parse(arguments)
    sys.path.append(os.getcwd())  # where an agent of one's own usually is
    number("--seconds", args.seconds, above=0.0, below=recording.LONGEST)
    encode = None
    if args.out is not None:
        encode = recording.encoder(args.out.suffix)
        files.prepare(args.out.parent, names=[args.out.name])
    text = trained(args.controller) if Path(args.controller).is_dir() else args.controller
    place, name, agent = entered(text, args.env)
    env = observed(place, name, agent, args, "human" if encode is None else "rgb_array")
    task: Task = env.unwrapped.task  # type: ignore[attr-defined]
    instants = recording.run(env, agent, args.seconds, args.seed, asked(args, place, task))
    what = f"{args.controller} in {place.environment}, seed {args.seed}"
    try:
        if encode is None:
            last, closed = show(instants)
            print(told(what, last, closed))
        else:
            every = recording.stride(args.out.suffix, task.control_period)
            data, count, last = recording.record(env, instants, encode, every)
            files.write_bytes(args.out, data)
            print(f"{told(what, last)}\n{count} frames, {len(data) / 1e6:.2f} MB: {args.out}")
    finally:
        env.close()
    return 0


def trained(folder: str) -> str:
    """The policy in the folder of a training.

    Raises:
        ValueError: it holds none, or none yet.
    """
    if (Path(folder) / TRAINED).is_file():
        return str(Path(folder) / TRAINED)
    best = Path(folder) / "best.safetensors"
    if best.is_file():
        see = f"{starting.line('watch')} {best}"
        raise ValueError(f"{folder}: its training is not at its end; the best policy so far: {see}")
    raise ValueError(f"{folder}: is no training's folder, it holds no {TRAINED}: {starting.line('train')} writes one")


def entered(text: str, environment: str | None) -> tuple[Scenario, str, Agent]:
    """The scenario of the environment with the controller, the controller's name in it, and itself.

    Raises:
        ValueError: there is no such controller, or it cannot act there.
        ImportError: an extra is missing.
    """
    if environment is None and text.endswith(".safetensors"):
        environment = MlpPolicy.load(text).card.environment
    environment = choice("environment", environment or "SMOPendulum-v0", configs.OF_ENVIRONMENT)
    place = scenario.named(configs.OF_ENVIRONMENT[environment])
    name = text.removesuffix(place.suffix) if text.removesuffix(place.suffix) in place.controllers else text
    if name not in place.controllers:
        if not named.named(text):
            names = unknown(f"controller of {environment}", text, {*place.controllers, named.SHIPPED})
            raise ValueError(f"{names}, a training's folder, PATH.safetensors, PATH.zip and module:Class")
        place = place.with_agent(text)
    return place, name, place.agent(name)


def observed(
    place: Scenario, name: str, agent: Agent, args: argparse.Namespace, mode: str
) -> gymnasium.Env[Array, Array]:
    """The environment with the observer that was asked for.

    Raises:
        ValueError: the observer cannot work there.
    """
    dt = place.period(agent)
    options: dict[str, Any] = {"control_period": dt, "horizon": max(round(args.seconds / dt), 1) * dt}
    options |= {} if args.uncertainty is None else {"uncertainty": args.uncertainty}
    options |= {} if place.reference is None else {"preview": 0}
    env = gymnasium.make(place.environment, render_mode=mode, **options)
    arm = ARMS[arm_of(agent, args.observer, args.compensation)]
    arm.check(place)
    observer = arm.observer(place.controllers[name].observer, place, env.unwrapped.task)  # type: ignore[attr-defined]
    return ObserverWrapper(env, observer)


def arm_of(agent: Agent, observer: str | None, compensation: str | None) -> str:
    """The name of the arm; of a policy where nothing is asked, that of its training.

    Raises:
        ValueError: compensation is asked of an observer that has no such switch.
    """
    if observer in (None, SMO):
        own = ARM_OF.get(agent.card.observation) if isinstance(agent, MlpPolicy) and observer is None else None
        return COMPENSATION.get(compensation, compensation) if compensation else own or COMPENSATION["on"]
    if compensation is not None:
        raise ValueError(f"--compensation {compensation} is for the observer smo, not --observer {observer}")
    return observer


def asked(args: argparse.Namespace, place: Scenario, task: Task) -> dict[str, Any]:
    """The reset options of the command line: where the run begins, and on which plant.

    Raises:
        ValueError: there is no such case, or a state or parameter is not allowed.
    """
    if args.state and args.case:
        raise ValueError(f"--state {' '.join(map(str, args.state))} and --case {args.case}: give one of them")
    cases = dict(zip(map(str, range(1, 5)), place.initial_states.value.values(), strict=False))
    state = args.state or cases[choice(f"case of {place.environment}", args.case or "1", cases)]
    for what, value, most in (("h", state[0], task.track_limit), ("theta", state[1], task.angle_limit)):
        if abs(value) > most:
            raise ValueError(f"--state: {what}={value:g} must be from {-most:.4g} to {most:.4g} in {place.environment}")
    params: dict[str, float] = {}
    for pair in args.params:
        name, _, value = pair.partition("=")
        try:
            params[name] = real(value)
        except argparse.ArgumentTypeError:
            raise ValueError(f"--params: {pair!r} must be NAME=X, such as rod_length=0.6") from None
    options = {"state": state, **({"params": params} if params else {})}
    task.asked(options)
    return options


def show(instants: Any) -> tuple[recording.Instant, bool]:
    """A window's run: its last instant, and whether the user closed the window.

    Raises:
        ValueError: there is no display.
    """
    try:
        last = next(instants)
    except RuntimeError as error:
        reason = str(error).partition("(")[2].partition(")")[0] or error
        raise ValueError(f"no window can be shown ({reason}): say --out FILE.gif, .webp or .mp4") from None
    for last in instants:
        if closed_by_user():
            return last, True
    return last, False


def told(what: str, last: recording.Instant, closed: bool = False) -> str:
    """How a run ended, in a sentence."""
    h, theta = last.state[:2]
    end = "failed" if last.failed else "was closed" if closed else "ends"
    off = np.abs(last.estimate - last.state)
    return (
        f"{what}: {end} after {last.time:.4g} s at h = {h:.3g} m, theta = {theta:.3g} rad; the estimate is off by "
        f"{off[0]:.2g} m, {off[1]:.2g} rad, {off[2]:.2g} m/s, {off[3]:.2g} rad/s"
    )
