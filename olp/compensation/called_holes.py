"""Holes of cycles that blocks call with levels of their own.

The block that goes to a hole is right in the middle of its stroke. The call is written again before it, with
other levels where its bottom needs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.compensation.digits import AxisRows
from olp.compensation.hole_levels import CalledLevels
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Index
from olp.core.toolpath import Kind
from olp.program.holes import Small
from olp.program.program import Called
from olp.program.text.edits import EditList, Edits


class CalledHoles:
    """Writes the holes of one program, band by band."""

    def __init__(self) -> None:
        self._levels = CalledLevels()

    def middled(self, writer: Writer, rows: Rows, columns: list[AxisRows]) -> list[AxisRows]:
        """Columns of the words, with the position of each hole as the middle of its stroke needs it."""
        strokes = _among(writer.program.called, rows)[0]
        if not len(strokes):
            return columns
        # the last row of the move to the hole
        top, bottom = (np.searchsorted(rows.move, strokes[:, k], "right") - 1 for k in (0, 1))
        good = top >= 0
        top, bottom = top[good], bottom[good]
        for axis in (0, 1):
            away = np.nan_to_num(columns[axis].command - columns[axis].nominal)
            command = columns[axis].command.copy()
            command[top] += (away[bottom - 1] + away[bottom]) / 2 - away[top]
            columns[axis] = replace(columns[axis], command=command)
        return columns

    def edits(self, writer: Writer, rows: Rows, a: int, b: int) -> Edits:
        """Edits of the calls whose holes are rows a..b, and the positions after them."""
        made = EditList(writer.prefixes)
        called, path = writer.program.called, writer.path
        rows.emitted[a:b] = path.end_mm[rows.move[a:b]]
        rows.emitted[a:b, :2] = (rows.emitted[a - 1] if a else rows.entry)[:2]
        strokes, which = _among(called, rows)
        begins = set((rows.move.searchsorted(strokes[:, 1]) - 1).tolist())
        for (_, bottom), k in zip(strokes.tolist(), which.tolist(), strict=True):
            row = int(rows.move.searchsorted(bottom))
            if not a < row < b:
                continue
            back, lift = self._lifted(writer, rows, row, k, made)
            rows.emitted[row - 1 : row + 1, 2] += lift
            for behind in range(row + 1, b):
                if path.line[rows.move[behind]] != path.line[bottom] or behind in begins:
                    break
                # a cycle may come back to its clearance at a feed
                feeds = path.kind[rows.move[behind]] == Kind.LINE
                rows.emitted[behind, 2] += lift if feeds else back
        return made.done()

    def _lifted(self, writer: Writer, rows: Rows, row: int, k: int, made: EditList) -> tuple[float, float]:
        """How much higher than the program says the tool goes back, and a hole is, mm; writes its call with
        these levels."""
        path = writer.path
        move = int(rows.move[row])
        unit = float(writer.frame_unit_mm[path.frame[move]])
        decimals = writer.style.usual(2, unit)

        def lift(at: int) -> float:
            away = writer.plan.command_mm[rows.first + at, 2] - path.end_mm[rows.move[at], 2]
            return float(round(float(away) / unit * 10**decimals) / 10**decimals)

        last = row + 1
        while last < len(rows.move) and path.kind[rows.move[last]] == Kind.LINE:
            last += 1
        raised = path.line[rows.move[last : last + 1]] == path.line[move]
        down = lift(row)
        back = lift(last) if raised.any() else down
        line = int(path.line[move])
        self._levels.lift(writer.program, k, line, (back, down), decimals, made, writer.tally)
        return back * unit, down * unit


def _among(called: Called, rows: Rows) -> tuple[Index, Index]:
    """(k, 2) the strokes whose bottoms are among rows, and their numbers."""
    if not len(called) or not len(rows.move):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    low, high = np.searchsorted(called.strokes[:, 1], (rows.move[0], rows.move[-1] + 1))
    return called.strokes[low:high], np.arange(low, high)


def joined(called: Called, moves: Small, spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Spans of rows, those that begin with a hole being joined with the one before. (r,) `moves` of rows."""
    if not len(called):
        return list(spans)
    inside = set(called.strokes[:, 1].tolist())
    done = list(spans[:1])
    for first, last in spans[1:]:
        # a hole begins with the move before its bottom
        if int(moves[first]) + 1 in inside:
            done[-1] = (done[-1][0], last)
        else:
            done.append((first, last))
    return done
