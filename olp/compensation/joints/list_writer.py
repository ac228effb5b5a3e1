"""Writes the plan of a list of axis values into its rows: numbers changed and rows inserted, nothing else."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.writer import WrittenJoints
from olp.compensation.tally import Tally
from olp.core.arrays import Array, Index, Mask
from olp.core.spool import whole
from olp.program.pointlist.axis_list import AxisList
from olp.program.text.numbers import MOST_DECIMALS, number, spliced, written

#: The bit that makes a letter a small one.
_LOWER = 0x20


def write_list(path: JointPath, plan: JointPlan) -> WrittenJoints:
    """The text of a list of axis values with its plan. An inserted row is its own one again, with other axis
    values."""
    move, rows, tally = plan.move, path.listed, Tally()
    assert rows is not None
    head = np.append(plan.move[1:] != plan.move[:-1], True)[: len(move)]
    decimals = np.minimum(np.maximum(rows.decimals, path.places), MOST_DECIMALS)[move]
    scale = 10.0**decimals
    # no zero has a minus
    value = np.rint(plan.command * scale) / scale + 0.0
    # a number that is right to its last digit stays as it is written
    same = np.rint(rows.values[move] * scale) == np.rint(plan.command * scale)
    change = np.where(head[:, None], ~same, True)
    insert = _inserted(plan, value, head)
    edits: list[tuple[int, int, bytes]] = []
    _Cells(rows, value, decimals).edit(plan.move, head, change, insert, edits)
    if not edits:
        return WrittenJoints(None, tally, np.ones(len(path), np.int64))
    tally.changed_words = int((change & head[:, None]).sum())
    tally.inserted_blocks = int(insert.sum())
    text = spliced(whole(path.program.data), edits)
    return WrittenJoints(text, tally, np.bincount(move[head | insert], minlength=len(path)))


def _inserted(plan: JointPlan, value: Array, head: Mask) -> Mask:
    """(r,) rows that get a line of their own: a part that ends where it began needs none."""
    before = np.vstack((np.full((1, value.shape[1]), np.nan), value[:-1]))
    return np.asarray(~head & (value != before).any(axis=1))


class _Cells:
    """The numbers of a list, with what is written for them."""

    def __init__(self, rows: AxisList, value: Array, decimals: Index) -> None:
        self.rows, self.data = rows, rows.program.data
        self.value, self.decimals = value.tolist(), decimals.tolist()
        self.start, self.stop = rows.start.tolist(), rows.stop.tolist()
        self.plain = _plain(rows).tolist()

    def edit(
        self, move: Index, head: Mask, change: Mask, insert: Mask, edits: list[tuple[int, int, bytes]]
    ) -> None:
        """Put all edits into a list. A move's inserted rows come before its own one."""
        begin, end = self.rows.begin.tolist(), self.rows.end.tolist()
        changes = change.tolist()
        for row, (own, first, more) in enumerate(
            zip(move.tolist(), head.tolist(), insert.tolist(), strict=True)
        ):
            if first:
                for column in range(len(self.start[own])):
                    if changes[row][column]:
                        edits.append(
                            (self.start[own][column], self.stop[own][column], self._text(row, own, column))
                        )
            elif more:
                line = self.data[begin[own] : end[own]]
                cells = [
                    (self.start[own][column] - begin[own], self.stop[own][column] - begin[own],
                     self._text(row, own, column))
                    for column in range(len(self.start[own]))
                ]  # fmt: skip
                eol = self.rows.program.eol(int(self.rows.program.toolpath.line[own]))
                edits.append((begin[own], begin[own], spliced(line, cells) + eol))

    def _text(self, row: int, own: int, column: int) -> bytes:
        if self.plain[own][column] and self.decimals[row][column]:
            return b"%.*f" % (self.decimals[row][column], self.value[row][column])
        form = number(self.data[self.start[own][column] : self.stop[own][column]], self.rows.decimal)
        assert form is not None, "the reader refuses what is no number"
        value, decimals = self.value[row][column], self.decimals[row][column]
        # with an exponent the digits before the mark count as decimals
        decimals += len(f"{abs(value):.0f}") if form.letter else 0
        return written(form, value, decimals, self.rows.decimal)


def _plain(rows: AxisList) -> Mask:
    """(n, axes) numbers that need no look at their form: a whole part without plus and filling zeros, with a
    point and no exponent."""
    if rows.decimal != b".":
        return np.zeros(rows.values.shape, bool)
    text = np.frombuffer(rows.program.data, np.uint8)
    first = rows.start + (text[rows.start] == ord("-"))
    digits = _is_digit(text[first])
    filled = (text[first] == ord("0")) & _is_digit(text[np.minimum(first + 1, len(text) - 1)])
    letters = np.cumsum(np.append(0, (text | _LOWER == ord("e")) | (text | _LOWER == ord("d"))))
    return np.asarray(digits & ~filled & (letters[rows.stop] == letters[rows.start]), bool)


def _is_digit(byte: npt.NDArray[np.uint8]) -> Mask:
    return np.asarray((byte >= ord("0")) & (byte <= ord("9")), bool)
