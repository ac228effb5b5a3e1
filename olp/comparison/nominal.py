"""The nominal path of a program as a polyline, of axis positions or of the tip on the part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from olp.comparison.path import Path
from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index
from olp.core.geometry import arc_points
from olp.core.toolpath import Kind, Toolpath
from olp.errormodel.base import ErrorModel

#: mm; how far chords may be from their arcs.
CHORD_MM = 2e-5
#: Chords of an arc at most.
_MOST_CHORDS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """A path, and the move of the program that each of its segments (n,) is part of."""

    path: Path
    move: Index


def nominal_of(toolpath: Toolpath, model: ErrorModel | None, positions: Literal["tip", "axes"]) -> Nominal:
    """The commanded path of a program, arcs within CHORD_MM.

    "axes": axis positions in the machine frame. "tip": of the tip in the first work frame, as `simulate`
    states it. With a model, zeros that were touched off on the uncompensated machine are shifted by its error
    there. Moves of unknown axes are left out. Raises CannotCompute where no path is left.
    """
    shift = np.zeros((len(toolpath.frames), 3))
    if model is not None:
        shift = zero_shifts(toolpath.frames, model)
    end = targets(toolpath, shift)
    points, move = _chords(toolpath, end)
    if positions == "tip" and len(toolpath):
        first = int(toolpath.frame[0])
        home = toolpath.frames[first]
        lengths = toolpath.per_frame([f.length_mm for f in toolpath.frames])
        points = home.tip_mm(points - shift[first] - (lengths if lengths.ndim == 1 else lengths[move]))
    known = np.isfinite(points).all(axis=1)
    points, move = points[known], move[known]
    cutting = toolpath.kind[move] != Kind.RAPID
    path = Path.through(points, move, cutting)
    return Nominal(replace(path, line=toolpath.line[path.line].astype(np.int64)), path.line)


def _chords(toolpath: Toolpath, end: Array) -> tuple[Array, Index]:
    """Ends of moves and points on arcs (m, 3), and the move of each (m,)."""
    arcs = toolpath.arcs
    if not len(arcs):
        return end, np.arange(len(toolpath))
    steps = np.ones(len(toolpath), np.int64)
    start = toolpath.starts_mm()[arcs.move]
    radius = np.sqrt(np.nan_to_num((start - arcs.centre_mm) ** 2).sum(axis=1))
    angle = np.sqrt(8.0 * CHORD_MM / np.maximum(radius, CHORD_MM))
    steps[arcs.move] = np.clip(np.ceil(np.abs(arcs.sweep_rad) / angle), 1, _MOST_CHORDS).astype(np.int64)
    move = np.repeat(np.arange(len(toolpath)), steps)
    share = (np.arange(len(move)) - (np.cumsum(steps) - steps)[move] + 1) / steps[move]
    points = end[move]
    which = np.full(len(toolpath), -1)
    which[arcs.move] = np.arange(len(arcs))
    inner = np.flatnonzero((which[move] >= 0) & (share < 1.0))
    arc = which[move[inner]]
    points[inner] = arc_points(
        start[arc], toolpath.end_mm[arcs.move[arc]], arcs.centre_mm[arc], arcs.plane[arc],
        arcs.sweep_rad[arc], share[inner],
    ) + (end - toolpath.end_mm)[move[inner]]  # fmt: skip
    return points, move
