"""The animations of two environments' pages: ``python docs/images/animations.py``."""

from pathlib import Path

from smo_gym.cli.animate import encode, record
from smo_gym.evaluation import scenario

FOLDER = Path(__file__).parent

for name, case in {"upright": "theta(0) = 0.3", "tracking": ""}.items():
    frames = record(scenario.named(name), "lqr", case, seconds=5.0, seed=0)
    (FOLDER / f"{name}.gif").write_bytes(encode(frames, "GIF"))
