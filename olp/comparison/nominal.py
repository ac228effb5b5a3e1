"""The nominal path of a program as a polyline, of axis positions or of the tip on the part."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from olp.comparison.path import Path
from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import arc_points
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.proof.deviation import cutting_moves

#: mm; how far chords may be from their arcs.
CHORD_MM = 2e-5
#: Chords of an arc at most.
_MOST_CHORDS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """A path, the move of the program that each of its segments (n,) is part of, and that of each of its
    stops (k,)."""

    path: Path
    move: Index
    stop_move: Index


def nominal_of(
    toolpath: Toolpath, model: ErrorModel | None, positions: Literal["tip", "axes"], *, points: bool = False
) -> Nominal:
    """The commanded path of a program, arcs within CHORD_MM; `points`: its dialect has points, no paths.

    "axes": axis positions in the machine frame. "tip": of the tip in the first work frame, as `simulate`
    states it. With a model, zeros that were touched off on the uncompensated machine are shifted by its error
    there. Moves of unknown axes are left out. Raises CannotCompute where no path is left.
    """
    shift = np.zeros((len(toolpath.frames), 3))
    if model is not None:
        shift = zero_shifts(toolpath.frames, model)
    end = targets(toolpath, shift)
    place, move = _chords(toolpath, end)
    if positions == "tip" and len(toolpath):
        first = int(toolpath.frame[0])
        home = toolpath.frames[first]
        lengths = toolpath.per_frame([f.length_mm for f in toolpath.frames])
        place = home.tip_mm(place - shift[first] - (lengths if lengths.ndim == 1 else lengths[move]))
    known = np.isfinite(place).all(axis=1)
    place, move = place[known], move[known]
    along, at_end = counting(toolpath, points=points)
    path = Path.through(place, move, along[move], at_end[move])
    line = toolpath.line.astype(np.int64)
    stops = replace(path.stops, line=line[path.stops.line])
    return Nominal(replace(path, line=line[path.line], stops=stops), path.line, path.stops.line)


def counting(toolpath: Toolpath, *, points: bool) -> tuple[Mask, Mask]:
    """(n,) moves that count when measured, along their path and at their end, as in the table of judgements.
    Along the path counts all that cuts, also where the program leaves it uncorrected. At the end count the
    points of a program of points, and touches."""
    feed = toolpath.kind != Kind.RAPID
    hole = feed & ((toolpath.flag & np.uint8(Flag.CYCLE)) != 0)
    along = cutting_moves(toolpath) | hole
    own = (toolpath.flag & np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)) != 0
    at_end = ~along & ~own & (feed | points | (not feed.any()))
    return np.asarray(along, bool), np.asarray(at_end, bool)


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
