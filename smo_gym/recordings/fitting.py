"""A rig's model and noise fitted to its recordings, with standard errors: maximum likelihood of a filter's innovations.

An extended Kalman filter predicts each measurement; what is fitted makes all of them together most probable. That is a
grey box: the equations are given, their numbers are not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from ..typing import Array
from ..validation import choice
from .filtering import filtered
from .rig import Recording, Rig

ENOUGH = 0.02
"""By how much the loss may still fall, expected, where a fit counts as converged: a fifth of a standard error away."""
ROUNDS, ITERATIONS = 4, 60
_STEP = 0.3  # standard errors, of the differences that a Hessian is made of
_FIRST, _BEND = 1e-3, (1e-3, 1e3)

Loss = Callable[[Array], float]


class NotConverged(RuntimeError):
    """The search ended where the data would still like to go on, or where they do not say where to go."""


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
    """By how much the sum of -log is expected to fall still."""
    evaluations: int


def loss(rig: Rig, recordings: Sequence[Recording]) -> float:
    """-log of the likelihood of a rig's model and noise for each measurement, but for the constant."""
    runs = [filtered(rig, recording) for recording in recordings]
    return sum(run.loss for run in runs) / sum(run.innovations for run in runs)


def fit(rig: Rig, recordings: Sequence[Recording], held: Collection[str] = (), rounds: int = ROUNDS) -> Fit:
    """Fit the numbers of a rig's model, and its noise, from where they are.

    L-BFGS-B, in coordinates in which the loss bends the same in all directions; they are made anew where it ends, until
    nothing is left to win.

    Args:
        rig: where the search begins.
        recordings: of it.
        held: what is not fitted: of the rig's ``numbers``, or "noise" or "acceleration" with the name of a position
            behind it, as "noise h".
        rounds: of the search, at most.

    Raises:
        ValueError: a name that is held is not known.
        NotConverged: it did not converge; the message says why and what to do.
    """
    names = _names(rig)
    for name in held:
        choice("number", name, names)
    free = [i for i, name in enumerate(names) if name not in held]
    start, evaluations = _vector(rig), 0

    def total(values: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        vector = start.copy()
        vector[free] = values
        found = sum(filtered(_rig(rig, vector), recording).loss for recording in recordings)
        return found if np.isfinite(found) else np.finfo(float).max

    x = start[free]
    axes = np.diag([_bends(total, x, i) for i in range(len(free))])
    for _ in range(rounds):
        x = _searched(total, x, axes)
        slope, bend = _bent(total, x, axes)
        powers, turned = np.linalg.eigh(bend)
        left = 0.5 * float(((turned.T @ slope) ** 2 / np.abs(powers)).sum())
        if powers[0] > 0.0 and left < ENOUGH:
            errors = np.sqrt((axes @ np.linalg.inv(bend) * axes).sum(1))
            return _fit(rig, recordings, names, free, x, errors, left, evaluations)
        axes = axes @ turned / np.sqrt(np.abs(powers))
    worst = names[free[int(np.abs(axes[:, 0]).argmax())]]
    why = "is flat" if powers[0] <= 0.0 else f"would fall by another {left:.3g}"
    raise NotConverged(
        f"after {evaluations} evaluations the likelihood {why}, most of all along {worst!r}: hold what these "
        f"recordings do not tell apart (held={(*held, worst)!r}), or allow more rounds than {rounds}"
    )


def _names(rig: Rig) -> tuple[str, ...]:
    first, second = rig.model.names
    return (*rig.numbers, f"noise {first}", f"noise {second}", f"acceleration {first}", f"acceleration {second}")


def _vector(rig: Rig) -> Array:
    """All numbers; those of noise as logarithms."""
    return np.array([*rig.model.params, *np.log([*rig.noise, *rig.acceleration])])


def _rig(rig: Rig, vector: Array) -> Rig:
    *params, a, b, c, d = vector[:-4].tolist() + np.exp(vector[-4:]).tolist()
    return replace(rig.of(params), noise=(a, b), acceleration=(c, d))


def _bends(total: Loss, x: Array, i: int) -> float:
    """The step of one number that raises the loss by a half: its standard error if all others were known."""
    step, here = _FIRST * max(abs(x[i]), 10.0 * _FIRST), total(x)
    for _ in range(4):
        d = step * (np.arange(len(x)) == i)
        step /= np.sqrt(np.clip(abs(total(x + d) + total(x - d) - 2.0 * here), *_BEND))
    return float(step)


def _searched(total: Loss, x: Array, axes: Array) -> Array:
    here = total(x)
    options = {"maxiter": ITERATIONS, "maxfun": 10**6, "eps": 1e-2, "ftol": 1e-12, "gtol": 1e-2}
    found = minimize(lambda z: total(x + axes @ z) - here, np.zeros(len(x)), method="L-BFGS-B", options=options)
    return np.asarray(x + axes @ found.x)


def _bent(total: Loss, x: Array, axes: Array) -> tuple[Array, Array]:
    """Gradient and Hessian along axes, by central differences."""
    n, here, d = len(x), total(x), _STEP * axes
    more, less = (np.array([total(x + s * d[:, i]) for i in range(n)]) for s in (1.0, -1.0))
    bend = np.diag(more + less - 2.0 * here)
    for i in range(n):
        for j in range(i):
            both = total(x + d[:, i] + d[:, j]) + total(x - d[:, i] - d[:, j])
            bend[i, j] = bend[j, i] = 0.5 * (both - more[i] - less[i] - more[j] - less[j] + 2.0 * here)
    return (more - less) / (2.0 * _STEP), bend / _STEP**2


def _fit(
    rig: Rig,
    recordings: Sequence[Recording],
    names: tuple[str, ...],
    free: Sequence[int],
    x: Array,
    errors: Array,
    left: float,
    evaluations: int,
) -> Fit:
    vector = _vector(rig)
    vector[free] = x
    found = _rig(rig, vector)
    values, scales = vector.copy(), np.ones(len(vector))
    values[-4:] = scales[-4:] = np.exp(vector[-4:])
    return Fit(
        found,
        tuple(names[i] for i in free),
        values[free],
        errors * scales[free],
        loss(found, recordings),
        left,
        evaluations,
    )
