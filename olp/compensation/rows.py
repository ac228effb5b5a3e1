"""Rows of the plan that are being written: the position that each reaches as written, and its digits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.digits import Digits
from olp.compensation.plan import Plan
from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.toolpath import Kind, Toolpath
from olp.core.values import dataclass


@dataclass(slots=True, eq=False)
class Rows:
    """Consecutive rows of a plan, from row `first` of it on.

    (r,) `move`, `flag` and `take_up` are as in the plan and the path. `head` marks the row that keeps the
    text of its move, `before` the rows that are put in front of it, `arc` moves along arcs. (r, 3) `emitted`
    are axis positions in mm after each row as written, (3,) `entry` those before the first. (r, 3) `write`:
    the number changes or is new, and `mantissa` / 10**`decimals` is written.
    """

    first: int
    move: npt.NDArray[np.int32]
    flag: npt.NDArray[np.uint8]
    head: Mask
    before: Mask
    take_up: Mask
    arc: Mask
    emitted: Array
    entry: Array
    write: Mask
    mantissa: Index
    decimals: npt.NDArray[np.int8]

    @staticmethod
    def of(plan: Plan, path: Toolpath, first: int, last: int, entry: Array) -> Rows:
        """Rows `first`..`last` of a plan, nothing of which is written yet."""
        move = plan.move[first:last]
        count = len(move)
        rows = Rows(
            first=first,
            move=move,
            flag=path.flag[move],
            head=np.concatenate(([True], move[1:] != move[:-1])),
            before=np.zeros(count, bool),
            take_up=plan.take_up[first:last],
            arc=is_in(path.kind[move], (Kind.ARC_CW, Kind.ARC_CCW)),
            emitted=np.empty((count, 3)),
            entry=entry,
            write=np.zeros((count, 3), bool),
            mantissa=np.zeros((count, 3), np.int64),
            decimals=np.zeros((count, 3), np.int8),
        )
        rows._mark_take_ups()
        return rows

    def _mark_take_ups(self) -> None:
        """The first part of an arc keeps the arc's own text, so backlash is taken up in front of it."""
        row = np.flatnonzero(self.take_up & self.arc & self.head)
        self.before[row], self.head[row], self.head[row + 1] = True, False, True

    def __len__(self) -> int:
        return len(self.move)

    def serial(self, row: int) -> int:
        """Order of a row's words among insertions at one position of the text."""
        return row * 8 + 16

    def put(self, which: slice | Index, axis: int, digits: Digits) -> None:
        """The digits of one axis for some rows."""
        self.emitted[which, axis] = digits.emitted
        self.write[which, axis] = digits.write
        self.mantissa[which, axis] = digits.mantissa
        self.decimals[which, axis] = digits.decimals
