"""Estimate the velocities of a plant of your own from logged positions and inputs.

    smo-gym observe FILE.csv --observer ekf --model cart-pendulum
    smo-gym observe FILE.csv --observer ukf --model '{rod_length: 0.33, gravity: 9.81}'
    smo-gym observe FILE.csv --model my_plant:MODEL --positions arm alpha --input volts

Writes the estimates beside time and positions, and a picture of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .. import files
from ..evaluation import candidates, formats
from ..evaluation.report import figures, log_panels
from ..models import Model
from ..plant import CartPendulum
from ..policies import named
from ..recordings import RIGS, logged
from ..recordings.logged import Log
from ..typing import Array
from ..validation import unknown
from .arguments import Parser
from .entry import command

PLANT = "cart-pendulum"


@command("observe")
def main(arguments: Sequence[str] | None = None) -> int:
    """Estimate; 0 when all went well, 2 for a bad argument or file."""
    parser = Parser("observe", __doc__)
    parser.add_argument("file", type=Path, metavar="FILE.csv", help="with a header; # begins a comment")
    parser.add_argument("--observer", default="ekf", metavar="NAME", help="one of those that were tuned (default: ekf)")
    parser.add_argument(
        "--tuned",
        default="simulated",
        metavar="WHERE",
        help="simulated, cartpole, qube or FILE.yaml (default: simulated)",
    )
    parser.add_argument("--set", type=_mapping, default={}, metavar="YAML", help="settings of the observer, over those")
    parser.add_argument(
        "--model", default=PLANT, metavar="MODEL", help=f"{PLANT}, {', '.join(RIGS)}, fields as YAML, or module:NAME"
    )
    parser.add_argument("--time", metavar="COLUMN", help="in s (default: time or t)")
    parser.add_argument("--positions", nargs=2, default=["position", "angle"], metavar="COLUMN", help="both positions")
    parser.add_argument("--input", default="u", metavar="COLUMN", help="that acts until the next sample (default: u)")
    unit = parser.add_mutually_exclusive_group()
    unit.add_argument("--degrees", action="store_const", const=True, help="the angle is in degrees")
    unit.add_argument("--radians", dest="degrees", action="store_const", const=False, help="it is in radians, surely")
    parser.out("observed")
    args = parser.parse_args(arguments)
    where = Path(args.tuned)
    known = candidates.load(where) if where.suffix in (".yaml", ".yml") else candidates.named(args.tuned)
    model = _model(args.model)
    candidate = known[args.observer]
    tuned = candidates.merged(candidate.tuned.value if candidate.tuned else {}, args.set)
    observer: Any = candidate.build(model, tuned)
    log = logged.read(args.file, args.positions, args.input, args.time, args.degrees)
    xhat = observer.run(log.t, log.y, log.u, model=model)
    if not np.isfinite(xhat).all():
        k = int(np.argmin(np.isfinite(xhat).all(1)))
        raise ValueError(f"{args.file}: the estimate is lost at t={log.t[k]:g}: another --model, --observer or --set")
    _write(args, model, log, xhat)
    return 0


def _mapping(text: str) -> dict[str, Any]:
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        value = None
    if not isinstance(value, dict):
        raise argparse.ArgumentTypeError(f"{text!r} must be a mapping as YAML, such as '{{noise: [1e-4, 1e-3]}}'")
    return value


def _model(text: str) -> Model:
    """A model by name, the fields of a cart pendulum as YAML, or one of the user's own.

    Raises:
        ValueError: it is none of these.
    """
    if text == PLANT:
        return Model.of(CartPendulum())
    if text in RIGS:
        return RIGS[text].model
    if text.lstrip().startswith("{"):
        return Model.of(CartPendulum.of(_mapping(text), name="--model"))
    if ":" in text:
        found = getattr(named.imported(text.partition(":")[0]), text.partition(":")[2], None)
        if not isinstance(found, Model | CartPendulum):
            raise ValueError(f"--model {text}: must name a smo_gym.models.Model or a CartPendulum, it is {found!r}")
        return Model.of(found)
    raise ValueError(f"{unknown('model', text, [PLANT, *RIGS])}, its fields as YAML, or module:NAME")


def _write(args: argparse.Namespace, model: Model, log: Log, xhat: Array) -> None:
    names = args.positions
    header = ("time", *names, args.input, *(f"{name}_hat" for name in names), *(f"{name}_dot_hat" for name in names))
    table = formats.as_csv(header, np.column_stack([log.t, log.y, log.u, xhat]).tolist())
    results = ("estimates.csv", "estimates.png")
    with files.claimed(args.out, results) as out:
        figure = log_panels.draw(log, xhat, names)
        files.write_set(out, {results[0]: table, results[1]: figures.encode(figure, "png")})
    steps = np.diff(log.t)
    dt = float(np.median(steps))
    gaps = int((steps > 1.5 * dt).sum())
    print(f"{len(log.t)} samples, {1e3 * dt:.4g} ms apart, {gaps} gaps; observer {args.observer}")
    for c, name in enumerate(names):
        v, plain = xhat[1:, 2 + c], np.diff(log.y[:, c]) / steps
        print(
            f"  {name}': RMS {np.sqrt((v**2).mean()):.4g} a second; backward difference less estimate RMS "
            f"{np.sqrt(((plain - v) ** 2).mean()):.4g}, total variation {np.abs(np.diff(v)).sum():.4g} against "
            f"{np.abs(np.diff(plain)).sum():.4g}"
        )
    print(f"results are in {args.out}")
