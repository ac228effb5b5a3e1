"""The side of the backlash at the start of a cut, taken up in the rapid before it.

At the start of a program and after a tool change nothing is known of the side on which an axis rests in its
backlash. Where the first feed would begin so, the rapid before it goes past its end by the backlash and comes
back: after that the side is known.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from olp.compensation.plan import Limits, Plan
from olp.core.arrays import Array, Index, Mask, any_in_row, distinct
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import play_interval
from olp.program.bands import AHEAD

_Scalar = TypeVar("_Scalar", bound=np.generic)

#: Digits beyond the backlash by which a rapid goes past its end: rounding may take one at either end.
_DIGITS = 2.0
#: mm; the same where the last digit is not known.
_LEAST_MM = 1e-3
#: Moves that take no further block, beside those that keep the program's own command.
_FIXED = np.uint8(Flag.CYCLE | Flag.WHOLE | Flag.DELETED)


@dataclass(slots=True, eq=False)
class Known:
    """What is known of the play of the axes at the last row of a plan: its `command_mm` (3,), the backlash
    there (3,) and the least and greatest play (2, 3). `looked` (3,): since the axis was unknown last, a rapid
    has taken it up."""

    command_mm: Array = field(default_factory=lambda: np.full(3, np.nan))
    width_mm: Array = field(default_factory=lambda: np.zeros(3))
    play: Array = field(default_factory=lambda: np.full((2, 3), np.nan))
    looked: Mask = field(default_factory=lambda: np.zeros(3, bool))

    def unknown(self, command: Array, width: Array) -> Mask:
        """(r, 3) where the side of an axis is unknown at commands (r, 3) that follow; goes on to the last."""
        chain = np.vstack((self.command_mm, command))
        low, high = play_interval(chain, np.vstack((self.width_mm, width)), self.play)
        self.command_mm, self.width_mm = command[-1].copy(), width[-1].copy()
        self.play = np.stack((low[-1], high[-1]))
        return np.asarray((high - low > 1e-9)[1:] & (width > 0.0) & np.isfinite(command))

    def first(self, command: Array, where: Index, unknown: Mask) -> Mask:
        """(m, 3) where an axis has not taken up its backlash at one of the rows `where` before: that holds
        until its position is unknown."""
        first = np.zeros((len(where), 3), bool)
        for axis in range(3):
            passages = np.cumsum(np.isnan(command[:, axis]))
            rows = np.flatnonzero(unknown[where, axis])
            passage, index = np.unique(passages[where[rows]], return_index=True)
            first[rows[index[(passage > 0) | ~self.looked[axis]]], axis] = True
            last = int(passages[-1])
            self.looked[axis] = last in passage or (last == 0 and self.looked[axis])
        return first


def with_approaches(
    path: Toolpath, model: ErrorModel, rows: Plan, axes: Mask, limits: Limits, steady: Mask | None,
    known: Known, ahead_mm: Array,
) -> Plan:  # fmt: skip
    """The plan with a row before the end of each rapid after which a cut would begin with an unknown side of
    an axis of `axes` (3,). `steady` (n,) moves take no further block, None: there are none. `known` is that
    of the rows before, and becomes that of these. `ahead_mm` (k, 3) are the ends of the moves behind them."""
    width = model.backlash_at(rows.command_mm)
    if width is None or not limits.insert or not len(rows):
        return rows
    width = np.where(axes, np.maximum(np.nan_to_num(width), 0.0), 0.0)
    unknown = known.unknown(rows.command_mm, width)
    where = _rapids(path, rows, unknown)
    if steady is not None:
        where = where[~steady[rows.move[where]]]
    wanted = unknown[where] & known.first(rows.command_mm, where, unknown)
    where, wanted = where[any_in_row(wanted)], wanted[any_in_row(wanted)]
    if not where.size:
        return rows
    past = np.maximum(_DIGITS * limits.digit_mm, _LEAST_MM)
    side = _sides(np.vstack((path.end_mm, ahead_mm)), rows.move[where])
    # the drive leads by half of the backlash afterwards: together it moves by all of it
    step = np.where(wanted, side * (width[where] / 2 + past), 0.0)
    beyond = rows.command_mm[where] - step
    box = model.box_mm
    step = np.where((beyond < box[:, 0]) | (beyond > box[:, 1]), -step, step)

    def insert(column: npt.NDArray[_Scalar], new: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
        return np.insert(column, where, new, axis=0)

    share = np.nextafter(rows.reach[where], 0.0)
    return replace(
        rows,
        move=insert(rows.move, rows.move[where]),
        target_mm=insert(rows.target_mm, rows.target_mm[where] - step),
        command_mm=insert(rows.command_mm, rows.command_mm[where] - step),
        raw=insert(rows.raw, rows.raw[where]),
        reach=insert(rows.reach, share),
        take_up=insert(rows.take_up, np.zeros(len(where), bool)),
    )


def _rapids(path: Toolpath, rows: Plan, unknown: Mask) -> Index:
    """The last rows of rapids after which a cut begins while the side of an axis is unknown."""
    kind, flag = path.kind[rows.move], path.flag[rows.move]
    cutting = (kind != Kind.RAPID) & ~any_in_row(rows.raw)
    starts = np.flatnonzero(cutting[1:] & any_in_row(unknown[:-1])) + 1
    found = []
    for start in starts.tolist():
        k = start - 1
        while k > 0 and kind[k] == Kind.RAPID and flag[k] & np.uint8(Flag.CYCLE):
            k -= 1
        good = kind[k] == Kind.RAPID and not flag[k] & _FIXED and not rows.raw[k].any()
        deleted = k and bool(flag[k - 1] & np.uint8(Flag.DELETED))
        if good and not deleted and np.isfinite(rows.command_mm[k]).all() and unknown[k].any():
            found.append(k)
    return distinct(np.array(found, np.int64))


def _sides(end_mm: Array, move: npt.NDArray[np.int32]) -> Array:
    """(m, 3) the direction of the next motion of each axis after moves (m,), 1 where there is none in AHEAD
    moves: behind them any side is as good. `end_mm` (n, 3) are the ends of all moves."""
    side = np.ones((len(move), 3))
    for i, begin in enumerate(move.tolist()):
        for axis in range(3):
            ahead = end_mm[begin + 1 : begin + 1 + AHEAD, axis] - end_mm[begin, axis]
            moved = np.flatnonzero(np.nan_to_num(ahead) != 0.0)
            if moved.size:
                side[i, axis] = np.sign(ahead[moved[0]])
    return side
