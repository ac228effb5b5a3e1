"""Runs of moves: along each every axis goes one way as far as backlash counts, so it has one side of it."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask
from olp.core.values import dataclass

#: mm or deg that an axis moves by rounding alone: it turns nothing round.
_STILL = 1e-9
#: Share of a sample's step: an axis that turns round so near to an end of an arc does so at that end.
_EDGE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """(t,) runs in their order: `begin` and `end` are shares of `move`. An arc has a run for each stretch
    between places where an axis with backlash turns round, another move has one. `side` (t, axes) is on which
    side of its backlash each axis would be there without correction, 0 where that is not known."""

    move: Index
    begin: Array
    end: Array
    side: Array

    @staticmethod
    def of(path: JointPath, solid: Mask) -> Runs:
        """Those of the `solid` (n,) moves."""
        width = path.motion.width
        move = np.flatnonzero(solid)
        begin, end = np.zeros(len(move)), np.ones(len(move))
        side = np.zeros((len(move), len(width)))
        if not width.any() or not len(move):
            return Runs(move, begin, end, side)
        cut, share = _turning(path, move[path.curves.mask[move]])
        move, begin = np.append(move, cut), np.append(begin, share)
        order = np.lexsort((begin, move))
        move, begin = move[order], begin[order]
        end = np.append(np.where(move[1:] == move[:-1], begin[1:], 1.0), 1.0)
        rows = np.flatnonzero(np.isfinite(path.start[move]).all(axis=1))
        moved = np.zeros((len(move), len(width)))
        moved[rows] = _axes(path, move[rows], end[rows]) - _axes(path, move[rows], begin[rows])
        moves = np.abs(moved) > _STILL
        last = np.maximum.accumulate(np.where(moves, np.arange(len(move))[:, None], -1), axis=0)
        side = np.where(last >= 0, np.take_along_axis(np.sign(moved), np.maximum(last, 0), axis=0), 0.0)
        return Runs(move, begin, end, side * (width != 0.0))


def _axes(path: JointPath, move: Index, share: Array) -> Array:
    return path.motion.axes(path.at(move, share), path.tool[move], path.tip[move])


def _turning(path: JointPath, arc: Index) -> tuple[Index, Array]:
    """Arcs and the shares of them at which an axis with backlash turns round."""
    width, count = path.motion.width, path.curves.samples(arc, np.ones(len(arc))) + 1
    owner, step = spread(count + 1)
    if not len(owner):
        return arc, np.zeros(0)
    one = 1.0 / count[owner]
    axes = _axes(path, arc[owner], step * one)
    inner = np.flatnonzero((step > 0) & (step < count[owner]))
    behind, ahead = axes[inner] - axes[inner - 1], axes[inner + 1] - axes[inner]
    round_ = (behind * ahead <= 0.0) & (np.abs(behind) + np.abs(ahead) > _STILL) & (width != 0.0)
    at, column = np.nonzero(round_)
    first, second = behind[at, column], ahead[at, column]
    # the top of the parabola through three samples
    top = 0.5 * (first + second) / (first - second)
    rows = inner[at]
    share = (step[rows] + top) * one[rows]
    free = (share > _EDGE * one[rows]) & (share < 1.0 - _EDGE * one[rows])
    found = np.unique(np.stack((arc[owner[rows]][free], np.round(share[free], 9))), axis=1)
    return found[0].astype(np.int64), found[1]
