"""How much the deviation may be larger because the side of the backlash is not known yet."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, any_in_row
from olp.core.toolpath import Toolpath
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_interval


class UnknownSides:
    """What the unknown play changes at most, along a path that is gone through from its begin to its end. It
    shrinks with the range that an axis has moved, and is 0 once that range is the backlash."""

    def __init__(self, path: Toolpath, model: ErrorModel) -> None:
        self.path, self.model = path, model
        self.command, self.play = np.full((1, 3), np.nan), np.full((2, 3), np.nan)
        #: mm, at the end of the move before, and the largest at its start or end
        self.before: float | None = None
        self.largest = 0.0

    def of(self, first: int, groups: Index) -> Array:
        """(g,) mm: what it changes at the start or at the end of each group of moves, the last of which are
        `groups` (g,); `first` is the first move of the first one."""
        last = int(groups[-1]) + 1
        # a group without moves has the start of the move behind it
        unknown = self._unknown(first, last, min(last + 1, len(self.path)))
        before = unknown[:1] if self.before is None else [self.before]
        # behind that of the move before the first one
        largest = np.concatenate(([self.largest], np.maximum(unknown, np.append(before, unknown)[:-1])))
        if last > first:
            self.before, self.largest = float(unknown[last - first - 1]), float(largest[last - first])
        begin = np.minimum(np.concatenate(([first], groups[:-1] + 1)), len(self.path) - 1)
        return np.asarray(np.maximum(largest[groups - first + 1], largest[begin - first + 1]))

    def _unknown(self, first: int, last: int, more: int) -> Array:
        """(m,) mm at the ends of moves `first`..`more`; goes on to move `last`."""
        end = self.path.end_mm[first:more]
        chain = np.vstack((self.command, end))
        width = self.model.backlash_at(chain)
        assert width is not None
        low, high = play_interval(chain, width, self.play)
        row = last - first
        self.command, self.play = chain[row : row + 1], np.stack((low[row], high[row]))
        half = ((high - low) / 2)[1:]
        half[np.isnan(end)] = 0.0
        rows = np.flatnonzero(any_in_row(half > 0.0))
        unknown = np.zeros(len(end))
        tool = self.path.tool_mm(first, more)
        tool = tool if tool.ndim == 1 else tool[rows]
        for axis in range(3) if rows.size else ():
            ahead = np.zeros((len(rows), 3))
            ahead[:, axis] = half[rows, axis]
            change = self.model.error(end[rows], tool, ahead) - self.model.error(end[rows], tool, -ahead)
            unknown[rows] += np.linalg.norm(np.nan_to_num(change), axis=1) / 2
        return unknown
