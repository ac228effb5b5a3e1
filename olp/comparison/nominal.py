"""The nominal path of a program as a polyline, of axis positions or of the tip on the part."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from olp.comparison.path import Path, PathParts
from olp.compensation.plan import Targets, zero_shifts
from olp.core.arrays import Array, Index, Mask, all_in_row
from olp.core.geometry import ArcShapes
from olp.core.progress import Progress, silent
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.text.columns import apart, spans
from olp.proof.deviation import cutting_moves

#: mm; how far chords may be from their arcs.
CHORD_MM = 2e-5
#: Chords of an arc at most.
_MOST_CHORDS = 20_000
#: Moves at a time where there are arcs, which may have hundreds of chords each.
_MOVES = 1 << 10


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """A path, the move of the program that each of its segments (n,) is part of, and that of each of its
    stops (k,)."""

    path: Path
    move: Index
    stop_move: Index


def nominal_of(
    toolpath: Toolpath, model: ErrorModel | None, positions: Literal["tip", "axes"], *, points: bool = False,
    tell: Progress = silent,
) -> Nominal:  # fmt: skip
    """The commanded path of a program, arcs within CHORD_MM; `points`: its dialect has points, no paths.

    "axes": axis positions in the machine frame. "tip": of the tip in the first work frame, as `simulate`
    states it. With a model, zeros that were touched off on the uncompensated machine are shifted by its error
    there. Moves of unknown axes are left out. Raises CannotCompute where no path is left.
    """
    shift = np.zeros((len(toolpath.frames), 3))
    if model is not None:
        shift = zero_shifts(toolpath.frames, model)
    target = Targets(toolpath, shift)
    along, at_end = counting(toolpath, points=points)
    of_frames = [f.length_mm for f in toolpath.frames]
    parts = PathParts()
    for some in spans(len(toolpath), _MOVES if len(toolpath.arcs) else None):
        place, move = _chords(toolpath.part(some.start, some.stop), target[some])
        if positions == "tip":
            first = int(toolpath.frame[0])
            lengths = toolpath.per_frame(of_frames, some.start, some.stop)
            lengths = lengths if lengths.ndim == 1 else lengths[move]
            place = toolpath.frames[first].tip_mm(place - shift[first] - lengths)
        move += some.start
        known = all_in_row(np.isfinite(place))
        if not known.all():
            place, move = place[known], move[known]
        parts.put(place, move, along[move], at_end[move])
        tell("nominal path", some.stop / len(toolpath))
    path = parts.path()
    stops = replace(path.stops, line=_lines(toolpath, path.stops.line))
    return Nominal(replace(path, line=_lines(toolpath, path.line), stops=stops), path.line, path.stops.line)


def _lines(toolpath: Toolpath, move: Index) -> Index:
    """(n,) the lines of moves (n,)."""
    line = apart((len(move),), np.int64)
    for some in spans(len(line)):
        line[some] = toolpath.line[move[some]]
    return line


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
    shapes = ArcShapes.of(start, toolpath.end_mm[arcs.move], arcs.centre_mm, arcs.plane, arcs.sweep_rad)
    on_arcs = shapes.at(arc, share[inner])
    shift = end - toolpath.end_mm
    if shift.any():
        on_arcs += shift[move[inner]]
    points[inner] = on_arcs
    return points, move
