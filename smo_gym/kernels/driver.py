"""The closed loop, compiled once: it calls the blocks of a program and does not know what they are."""

import numpy as np

from ..typing import Array
from . import kernel
from .batch import LANES, VECTOR, load, store
from .blocks import ALIVE, FAILED, FORCE, XD, XHAT, Y0, X, Y, call

_LOOK = 16
"""After every so many control periods a block of slots is left that all had ended before: now their force is 0, too."""


@kernel
def drive(
    start: int,
    stop: int,
    rows: Array,
    program: Array,
    acts: int,
    samples: int,
    begin: int,
    end: int,
    substeps: int,
    reference: Array,
    recording: Array,
    positions: Array,
    readings: Array,
) -> None:
    """Control periods ``begin`` to ``end`` of slots ``start`` to ``stop``.

    Args:
        start: first slot.
        stop: one behind the last.
        rows: (rows, n), signals first, then each part's own; in place.
        program: what is called, (blocks, 3): address, first of its own rows, one behind them.
        acts: how many of these are called when a control period begins.
        samples: how many of the next are called at every sampling instant; the others when the period ends.
        begin: first control period.
        end: one behind the last.
        substeps: sampling instants of a period.
        reference: x_d at each sampling instant from the very first on, (instants, 4), alike in all slots; or empty.
        recording: measurements in place of a sensor's, (substeps, 2, n), of a single period; or empty.
        positions: filled with the true positions of the last period, (substeps, 2, n); or empty.
        readings: filled with what was measured in it, the rows Y and FORCE to STAMP, (substeps, 6, n); or empty.
    """
    work, kept = np.empty(rows.shape[0] * LANES), np.empty(4 * LANES)
    for first in range(start, stop, LANES):
        lanes = min(LANES, stop - first)
        # lanes that fill a vector repeat the first slot and are never stored: a scalar rest costs more
        width = lanes if lanes == 1 else (lanes + VECTOR - 1) // VECTOR * VECTOR
        load(work, 0, rows, first, lanes, width)
        for k in range(begin, end):
            for i in range(4 * LANES):
                kept[i] = work[XHAT * LANES + i]
            for p in range(acts):
                call(program[p, 0], work, work[program[p, 1] * LANES : program[p, 2] * LANES], width)
            for j in range(substeps):
                if reference.shape[0] > 0:
                    for r in range(4):
                        for i in range(width):
                            work[(XD + r) * LANES + i] = reference[k * substeps + j + 1, r]
                if recording.shape[0] > 0:
                    for i in range(2 * LANES):
                        work[Y0 * LANES + i] = work[Y * LANES + i]
                    load(work, Y, recording[j], first, lanes, width)
                for p in range(acts, acts + samples):
                    call(program[p, 0], work, work[program[p, 1] * LANES : program[p, 2] * LANES], width)
                if positions.shape[0] > 0:
                    store(work, X, positions[j], first, lanes)
                if readings.shape[0] > 0:
                    store(work, Y, readings[j, :2], first, lanes)
                    store(work, FORCE, readings[j, 2:], first, lanes)
            for p in range(acts + samples, program.shape[0]):
                call(program[p, 0], work, work[program[p, 1] * LANES : program[p, 2] * LANES], width)
            # an observer goes on in slots that have ended, for how long depends on the others: they show none of it
            for r in range(4):
                for i in range(width):
                    xhat = work[(XHAT + r) * LANES + i]
                    work[(XHAT + r) * LANES + i] = xhat if work[ALIVE * LANES + i] > 0.0 else kept[r * LANES + i]
            alive = 1.0
            if k % _LOOK == 0:
                alive = 0.0
                for i in range(width):
                    alive += work[ALIVE * LANES + i]
            for i in range(width):
                going = work[ALIVE * LANES + i]
                work[ALIVE * LANES + i] = 0.0 if work[FAILED * LANES + i] > 0.0 else going
            if alive == 0.0:
                break
        store(work, 0, rows, first, lanes)
