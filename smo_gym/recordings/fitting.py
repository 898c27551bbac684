"""A rig's model and noise fitted to its recordings, with standard errors: maximum likelihood of a filter's innovations.

An extended Kalman filter predicts each measurement; what is fitted makes all of them together most probable. That is a
grey box: the equations are given, their numbers are not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..typing import Array
from ..validation import choice
from .filtering import SETTLED, filtered
from .rig import Recording, Rig
from .searching import search

ROUNDS = 4
_NOISES = 4


class NotConverged(ValueError):
    """The search ended where the recordings would have it go on, or where they do not say where to go."""


@dataclass(frozen=True, slots=True)
class Fit:
    """What was found."""

    rig: Rig
    """The rig with these numbers."""
    names: tuple[str, ...]
    """Of what was fitted."""
    values: Array
    errors: Array
    """Standard errors, if the model is right and its noise white: what it gets wrong is not in them."""
    loss: float
    """-log of the likelihood for each measurement, but for the constant."""
    left: float
    """By how much the sum of -log may still fall."""
    evaluations: int


def numbers(rig: Rig) -> dict[str, float]:
    """What of a rig can be fitted, by name."""
    first, second = rig.model.names
    names = (*rig.numbers, f"noise {first}", f"noise {second}", f"acceleration {first}", f"acceleration {second}")
    return dict(zip(names, (*rig.model.params, *rig.noise, *rig.acceleration), strict=True))


def loss(rig: Rig, recordings: Sequence[Recording]) -> float:
    """-log of the likelihood of a rig's model and noise for each measurement, but for the constant."""
    runs = [filtered(rig, recording) for recording in recordings]
    return sum(run.loss for run in runs) / sum(run.innovations for run in runs)


def fit(
    rig: Rig,
    recordings: Sequence[Recording],
    held: Collection[str] = (),
    rounds: int = ROUNDS,
    told: Callable[[int], object] = lambda evaluations: None,
) -> Fit:
    """Fit the numbers of a rig's model, and its noise, from where they are.

    Args:
        rig: where the search begins.
        recordings: of it.
        held: what is not fitted: of the rig's ``numbers``, or "noise" or "acceleration" with the name of a position
            behind it, as "noise h".
        rounds: of the search, at most.
        told: of each evaluation of the likelihood.

    Raises:
        ValueError: a name that is held is not known, a recording is too short, or there are not fewer numbers than
            measurements, or none.
        NotConverged: it did not converge; the message says why and what to do.
    """
    names = tuple(numbers(rig))
    for name in held:
        choice("number", name, names)
    free = np.array([name not in held for name in names])
    for each in recordings:
        if len(each.t) <= SETTLED:
            raise ValueError(
                f"{each.name}: has {len(each.t)} samples, a fit wants more than {SETTLED} of each recording"
            )
    count = 2 * sum(len(each.t) - SETTLED for each in recordings)
    if not 0 < free.sum() < count:
        raise ValueError(
            f"{free.sum()} numbers, {count} measurements: must be some, and more: hold others, or add runs"
        )
    start = np.append(rig.model.params, np.zeros(_NOISES))
    evaluations = 0

    def at(values: Array) -> Rig:
        vector = start.copy()
        vector[free] = values
        return _scaled(rig, vector)

    def total(values: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        told(1)
        found = sum(filtered(at(values), recording).loss for recording in recordings)
        return found if np.isfinite(found) else np.finfo(float).max

    best = search(total, start[free], rounds)
    fitted = tuple(name for name in names if name not in held)
    if not best.converged:
        why = "is flat" if best.flat else f"would rise by another {best.left:.3g}"
        loosest = fitted[best.loosest]
        raise NotConverged(
            f"after {evaluations} evaluations the log-likelihood {why}, most of all along {loosest!r}: hold what "
            f"these recordings do not tell apart ({', '.join((*held, loosest))}), or allow more rounds than {rounds}"
        )
    found = at(best.x)
    noise = np.array([*found.noise, *found.acceleration])
    values, units = np.append(found.model.params, noise), np.append(np.ones(len(found.model.params)), noise)
    errors = best.errors * units[free]
    return Fit(found, fitted, values[free], errors, loss(found, recordings), best.left, evaluations)


def _scaled(rig: Rig, vector: Array) -> Rig:
    """A rig with numbers of its model, and with its noise larger by the exponentials of the last four."""
    a, b, c, d = (np.array([*rig.noise, *rig.acceleration]) * np.exp(vector[-_NOISES:])).tolist()
    return replace(rig.of(vector[:-_NOISES].tolist()), noise=(a, b), acceleration=(c, d))
