"""A path of the tip as straight segments, each with its move."""

from __future__ import annotations

import numpy as np

from olp.clearance.distance import Swept
from olp.clearance.parts import Part
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, arc_points
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass

#: mm; how far a chord may be from its arc
CHORD_MM = 5e-4
#: mm; longer segments are cut, so that the boxes around them are small
_LONG_MM = 25.0


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Straight segments of the tip: (k, 3) `start` and `travel` in mm, (k,) `move` of the path."""

    start: Array
    travel: Array
    move: Index

    def of_moves(self, moves: Mask) -> Segments:
        """The segments of the moves marked in (n,) `moves`."""
        rows = np.flatnonzero(moves[self.move])
        return Segments(self.start[rows], self.travel[rows], self.move[rows])

    def swept(self, part: Part) -> Swept:
        """A part of a tool swept along all of them."""
        count = len(self.move)
        return Swept(
            self.start, self.travel, np.tile(np.array(part.level_mm), (count, 1)),
            np.tile(np.array(part.radius_mm), (count, 1)),
        )  # fmt: skip


def segments_of(path: Toolpath, start_mm: Array, end_mm: Array) -> Segments:
    """The segments of the moves of a path whose tip goes from `start_mm` to `end_mm` (n, 3).

    Moves with an unknown end (NaN) are left out. Arcs keep their shape of the path, in chords within
    `CHORD_MM`."""
    known: Mask = np.asarray(np.isfinite(start_mm + end_mm).all(axis=1))
    length = np.zeros(len(path))
    length[known] = np.sqrt(((end_mm - start_mm)[known] ** 2).sum(axis=1))
    steps = np.where(known, np.maximum(np.ceil(length / _LONG_MM), 1), 0).astype(np.int64)
    arcs, arc_move = path.arcs, path.arcs.move
    bulge = path.starts_mm()
    if len(arcs):
        away = bulge[arc_move] - arcs.centre_mm
        away[np.arange(len(arc_move)), np.array([axes[2] for axes in PLANES])[arcs.plane]] = 0.0
        radius = np.sqrt((away * away).sum(axis=1))
        turn = 2 * np.arccos(np.clip(1.0 - CHORD_MM / np.maximum(radius, CHORD_MM), -1.0, 1.0))
        chords = np.ceil(np.abs(arcs.sweep_rad) / np.maximum(turn, 1e-6))
        steps[arc_move] = np.where(known[arc_move], np.maximum(chords, steps[arc_move]), 0).astype(np.int64)
    move = np.repeat(np.arange(len(path)), steps)
    share = (np.arange(len(move)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.maximum(steps[move], 1)
    ends = [
        start_mm[move] + s[:, None] * (end_mm - start_mm)[move] for s in (share, share + 1.0 / steps[move])
    ]
    if len(arcs):
        which = np.full(len(path), -1)
        which[arc_move] = np.arange(len(arc_move))
        rows = np.flatnonzero(which[move] >= 0)
        arc, own = which[move[rows]], move[rows]
        for end, s in zip(ends, (share, share + 1.0 / steps[move]), strict=True):
            on = arc_points(
                bulge[own],
                path.end_mm[own],
                arcs.centre_mm[arc],
                arcs.plane[arc],
                arcs.sweep_rad[arc],
                s[rows],
            )
            # the tip's offset from the commanded arc is interpolated between both ends
            end[rows] += on - (bulge[own] + s[rows, None] * (path.end_mm[own] - bulge[own]))
    return Segments(ends[0], ends[1] - ends[0], move)
