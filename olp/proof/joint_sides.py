"""On which side of their backlash the axes of a machine with rotary joints are, along a program."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.errormodel.reversal import play_after, play_interval, taken_up

#: Places inside of a move at which the play is followed, to one of those at which errors are looked at.
_FINER = 2
#: Axes that are followed at a time.
_AT_A_TIME = 3


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """(m, axes) axis values of a path at the `start` and `end` of its moves, NaN where unknown.

    The play is followed at places (c,): `key` is the move and the part of it that is behind, `axes` are the
    values there, and `least` and `greatest` (c, axes) the sides that are possible."""

    path: JointPath
    start: Array
    end: Array
    key: Array
    axes: Array
    least: Array
    greatest: Array

    @staticmethod
    def of(path: JointPath) -> Sides:
        motion, moves = path.motion, np.arange(len(path))
        start, end = path.axes(moves, path.start), path.axes(moves, path.end)
        if not motion.width.any():
            return Sides(path, start, end, np.zeros(0), *np.zeros((3, 0, end.shape[1])))
        rows = np.flatnonzero(np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1))
        # axes turn round inside of moves that do not lead them evenly
        owner, step = spread(count := _FINER * path.samples(rows, start[rows], end[rows]))
        part = (step + 1) / (count + 1)[owner]
        inner = motion.axes(path.at(rows[owner], part), path.tool[rows[owner]], path.tip[rows[owner]])
        key = np.concatenate(([0.0], np.arange(1.0, len(end) + 1.0), rows[owner] + part))
        order = np.argsort(key, kind="stable")
        # one row more, where there is no move
        first = np.vstack((start, np.full((1, len(motion.width)), np.nan)))[:1]
        axes = np.vstack((first, end, inner))[order]
        return Sides(path, start, end, key[order], axes, *_intervals(axes, motion.width))

    def at(self, rows: Index, part: Array) -> tuple[Array, Array]:
        """(r, axes) the sides at parts of moves, in the middle of what is possible, and half of the range of
        what is."""
        path, motion = self.path, self.path.motion
        if not len(self.key):
            return np.zeros((len(rows), self.end.shape[1])), np.zeros((len(rows), self.end.shape[1]))
        here = motion.axes(path.at(rows, part), path.tool[rows], path.tip[rows])
        last = np.searchsorted(self.key, rows + part, "right") - 1
        before = np.where(self.key[last, None] == rows[:, None], self.start[rows], self.axes[last])
        moved = np.nan_to_num(here - before)
        width = np.broadcast_to(motion.width, moved.shape)
        least, greatest = (play_after(side[last], moved, width) for side in (self.least, self.greatest))
        used = motion.width != 0.0
        return 0.5 * (least + greatest) * used, 0.5 * (greatest - least) * used

    def taken_up(self, rows: Index, part: Array) -> tuple[Index, Array]:
        """(k,) moves and the parts of them at which an axis that turned round has taken up its backlash:
        there a load is off farthest. `rows` and `part` (r,) are places in order, which follow the play."""
        if not len(self.key) or not len(rows):
            return np.zeros(0, np.int64), np.zeros(0)
        motion, (side, _) = self.path.motion, self.at(rows, part)
        here = motion.axes(self.path.at(rows, part), self.path.tool[rows], self.path.tip[rows])
        next_ = np.flatnonzero(rows[1:] == rows[:-1])
        moved = (here[1:] - here[:-1])[next_]
        width = np.broadcast_to(motion.width, moved.shape)
        step, _, share = taken_up(side[next_], side[next_ + 1], moved, width)
        at = next_[step]
        return rows[at], part[at] + share * (part[at + 1] - part[at])


def _intervals(axes: Array, width: Array) -> tuple[Array, Array]:
    """(c, axes) the least and the greatest side at each of successive axis values."""
    least, greatest = np.zeros(axes.shape), np.zeros(axes.shape)
    for first in range(0, axes.shape[1], _AT_A_TIME):
        columns, widths = np.zeros((len(axes), _AT_A_TIME)), np.zeros(_AT_A_TIME)
        part = slice(first, min(first + _AT_A_TIME, axes.shape[1]))
        size = part.stop - first
        columns[:, :size], widths[:size] = axes[:, part], width[part]
        low, high = play_interval(columns, widths)
        least[:, part], greatest[:, part] = low[:, :size], high[:, :size]
    return least, greatest
