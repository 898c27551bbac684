"""A folder that keeps what groups gave, one file a group, so that a study that was stopped goes on with the rest."""

from __future__ import annotations

import hashlib
import io
import json
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numba
import numpy as np
import safetensors
import scipy
from llvmlite.binding import get_host_cpu_name

from .. import files
from ..policies import named
from ..typing import Array
from . import metrics
from .arms import arm
from .settings import PolicySettings
from .study import Group, Outcome
from .traces import Traces

FOLDER = ".groups"
"""Name of the store's folder, inside of the folder for results."""
SUFFIX = ".group"
PACKAGE = Path(__file__).resolve().parents[1]
COMPUTES = (gymnasium, numba, np, safetensors, scipy)
"""Packages whose versions may move a bit."""
_DIGEST = hashlib.sha256().digest_size


@cache
def code() -> dict[str, str]:
    """What computes: versions, and a hash of this package's sources, shipped policies and reference."""
    kinds = (".py", ".json", ".safetensors")
    sources = sorted(path for path in PACKAGE.rglob("*") if path.suffix in kinds)
    digest = hashlib.sha256()
    for path in sources:
        digest.update(f"{path.relative_to(PACKAGE).as_posix()}\0{_hash(path)}\n".encode())
    versions = {package.__name__: package.__version__ for package in COMPUTES}
    return {"python": platform.python_version(), **versions, "smo_gym": digest.hexdigest()}


def digest(told: Any) -> str:
    """Hash of what numbers depend on: what is told, as JSON, what computes them, and the processor."""
    whole = [told, code(), platform.machine(), get_host_cpu_name()]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


class Store:
    """Keeps groups in a folder; a file that is damaged or of something else is as none.

    Args:
        folder: that nobody else writes to meanwhile.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def key(self, group: Group, seed: int, samples: int | None) -> str | None:
        """Hash of all that a group depends on.

        None where code of the user's own takes part, in agent, observer, meter, disturbance or environment, of which no
        hash can be relied on.
        """
        scenario, settings = group.scenario, group.settings
        maker = arm(group.arm).observer
        makers = [getattr(maker, "func", maker), *(meter.finish for meter in metrics.METERS.values())]
        if "disturbance" in scenario.options and any(each.function for each in scenario.task.disturbance):
            return None
        if not _is_ours(scenario.environment) or not all(maker.__module__.startswith("smo_gym.") for maker in makers):
            return None
        policy = []
        if isinstance(settings, PolicySettings):
            if not named.is_data(settings.agent):
                return None
            if settings.agent != named.SHIPPED:
                path = Path(settings.agent)
                try:
                    policy = [_hash(path), _hash(path.with_suffix(".json"))]
                except OSError:  # who loads it will name it
                    return None
        reference, spec = scenario.trajectory(), gymnasium.spec(scenario.environment)
        told = {
            "scenario": scenario.model_dump(mode="json", exclude={"controllers"}),
            "reference": None if reference is None else reference.to_json(),
            "settings": settings.model_dump(mode="json"),
            "group": [group.controller, group.uncertainty, group.case, group.arm, group.runs, arm(group.arm).settings],
            "study": [seed, samples],
            "policy": policy,
            "environment": [str(spec.entry_point), str(spec.vector_entry_point), spec.max_episode_steps],
        }
        return digest(told)

    def get(self, key: str, group: Group) -> Outcome | None:
        """What is kept of a group under a key; None where there is nothing, or nothing whole."""
        found = self.read(key)
        if found is None:
            return None
        traces: dict[str, Any] = {field.name: found.get(f"trace:{field.name}") for field in fields(Traces)}
        return Outcome(
            group,
            dict(zip(found["names"].tolist(), found["metrics"], strict=True)),
            found["failed"].astype(np.bool_, copy=False),
            Traces(**traces) if traces["time"] is not None else None,
            found.get("plants"),
        )

    def put(self, key: str, outcome: Outcome) -> None:
        """Keep what a group gave. Where it cannot be written it is not kept, and a later study runs the group again."""
        arrays: dict[str, Any] = {
            "names": np.array(list(outcome.metrics)),
            "metrics": np.array(list(outcome.metrics.values())),
            "failed": outcome.failed,
            "plants": outcome.plants,
        }
        if outcome.traces is not None:
            arrays |= {f"trace:{field.name}": getattr(outcome.traces, field.name) for field in fields(Traces)}
        self.write(key, {name: values for name, values in arrays.items() if values is not None})

    def read(self, key: str) -> dict[str, Array] | None:
        """The arrays that are kept under a key; None where there are none, or none whole."""
        try:
            data = self._path(key).read_bytes()
        except OSError:
            return None
        if data[:_DIGEST] != _sum(key, data[_DIGEST:]):
            return None
        with np.load(io.BytesIO(data[_DIGEST:]), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}

    def write(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep arrays, where they can be written."""
        file = io.BytesIO()
        np.savez(file, **arrays)
        with suppress(OSError):
            files.write_bytes(self._path(key), _sum(key, file.getvalue()) + file.getvalue())

    def remove(self) -> None:
        """Remove all that was kept, and nothing else."""
        for path in self.folder.glob(f"*{SUFFIX}"):
            if path.is_file():
                path.unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"


@contextmanager
def kept(out: Path) -> Iterator[Store]:
    """A store inside of a folder for results, which stays when a block fails or is stopped and goes when it is done.

    Raises:
        ValueError: it cannot be written to.
    """
    folder = out / FOLDER
    try:
        with files.claimed(folder):
            store = Store(folder)
            yield store
            store.remove()
    finally:
        with suppress(OSError):  # it holds something
            folder.rmdir()


def _is_ours(environment: str) -> bool:
    """Whether an environment is one of this package, as it was registered."""
    spec = gymnasium.spec(environment)
    makers = (spec.entry_point, spec.vector_entry_point)
    ours = all(isinstance(maker, str) and maker.startswith("smo_gym.envs.") for maker in makers)
    return ours and not spec.kwargs and not spec.additional_wrappers


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _sum(key: str, data: bytes) -> bytes:
    """A check of a file's data and of the key that it is kept under."""
    return hashlib.sha256(key.encode() + data).digest()
