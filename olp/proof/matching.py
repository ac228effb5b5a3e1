"""Which moves of a corrected program belong to which move of the nominal one, from the two paths alone."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.program.program import Program

#: mm; a waypoint counts as reached within this where nothing comes nearer; corrections are far smaller
GATE_MM = 0.05
#: moves that are compared at once
_BLOCK = 4096
#: kinds of moves along arcs
_ARCS = (Kind.ARC_CW, Kind.ARC_CCW)


def match(program: Program, target_mm: Array, corrected: Program, model: ErrorModel, near_mm: float) -> Index:
    """(n,) index of the last move of `corrected` for each move of `program`, whose waypoints are
    `target_mm`.

    Waypoints are sought in order: the next move that comes within `near_mm`, else the nearest of those within
    the gate. Raises ProgramError where one is not reached: then the two programs are not the same job.
    """
    nominal, path = program.toolpath, corrected.toolpath
    count, extra = len(nominal), len(path) - len(nominal)
    if extra < 0:
        raise ProgramError(
            f"the corrected program has {len(path)} moves, fewer than the {count} of the nominal one, so it "
            "is not a correction of it; give the two programs of one job"
        )
    if extra == 0:
        return np.arange(count)
    play = plays(model, path.end_mm)
    actual = path.end_mm + np.nan_to_num(model.error(path.end_mm, path.tool_mm(), play))
    free = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE | Flag.CYCLE)
    loose = ((nominal.flag & free) != 0) | ~np.isfinite(target_mm).all(axis=1)
    # the step that takes up backlash before a whole circle ends where the circle ends, but is no part of it
    curved = np.isin(nominal.kind, _ARCS)
    straight = ~np.isin(path.kind, _ARCS)
    groups = np.zeros(count, np.int64)
    i = j = 0
    while i < count:
        span = min(_BLOCK, count - i, len(path) - j)
        away = np.abs(actual[j : j + span] - target_mm[i : i + span]).max(axis=1, initial=0.0)
        near = ((away < near_mm) & ~(curved[i : i + span] & straight[j : j + span])) | loose[i : i + span]
        run = span if near.all() else int(np.argmin(near))
        groups[i : i + run] = np.arange(j, j + run)
        i, j = i + run, j + run
        if i == count or (run == span and span):
            continue
        ahead = np.abs(actual[j : j + extra + 1] - target_mm[i]).max(axis=1, initial=0.0)
        if curved[i]:
            ahead[straight[j : j + extra + 1]] = np.inf
        skip = (
            int(np.argmax(ahead < near_mm))
            if (ahead < near_mm).any()
            else int(np.argmin(ahead))
            if len(ahead)
            else -1
        )
        if skip < 0 or ahead[skip] > GATE_MM:
            raise ProgramError(
                f"no move of the corrected program comes within {GATE_MM:g} mm of the end of line "
                f"{int(nominal.line[i])} of the nominal one; it is not a correction of this program for this "
                "machine",
                line=int(path.line[min(j, len(path) - 1)]),
            )
        groups[i] = j + skip
        extra -= skip
        i, j = i + 1, j + skip + 1
    last = len(path) - 1
    if count and groups[-1] < last and np.abs(actual[last] - target_mm[-1]).max() < near_mm:
        # a whole circle at the end comes to its last point twice
        groups[-1] = last
    return groups
