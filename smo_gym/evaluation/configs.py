"""The settings that come with the package, a YAML file each: scenarios, an operating set, hyperparameters."""

from __future__ import annotations

from pathlib import Path

from ..validation import choice

OF_ENVIRONMENT = {
    "SMOPendulum-v0": "initial-conditions",
    "SMOPendulumUpright-v0": "upright",
    "SMOPendulumTracking-v0": "tracking",
}
"""The scenario that an environment's own LQR and initial states stand in, by name."""


def folder() -> Path:
    """The folder of these files: inside an installed package, beside the package in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def names() -> list[str]:
    """Names of the files of settings: regulation, tracking and others."""
    return sorted(path.stem for path in folder().glob("*.yaml"))


def path(name: str) -> Path:
    """The file of settings of a name.

    Raises:
        ValueError: there is none of this name.
    """
    return folder() / f"{choice('settings', name, names())}.yaml"
