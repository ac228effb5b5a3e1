"""Writes a plan back into lists and described languages: numbers in their own form and column, and copies
of a statement where its move is split."""

from __future__ import annotations

import sys
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from olp.compensation.point_writer import PointWriter
from olp.compensation.rows import Rows
from olp.core.arrays import Index
from olp.core.errors import ProgramError
from olp.core.spool import whole
from olp.program.text.numbers import Number, Placing, number, spliced, written

#: Bytes of the text from one position up to another, and what replaces them.
Replacement = tuple[int, int, bytes]


class VerbatimWriter(PointWriter):
    """A writer of numbers that keep their own form; several moves may share one number."""

    #: Rows at a time: all, as moves far apart may share a number.
    chunk: ClassVar[int] = sys.maxsize

    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        if not len(self.words.start):
            # the text states the position of none of the moves
            self.parts[:] = 1
            return None
        self._digits(rows)
        replacements = [*self._changes(rows), *self._insertions(rows)]
        return spliced(whole(self.program.data), replacements) if replacements else None

    def _changes(self, rows: Rows) -> list[Replacement]:
        """Numbers of the statements that are there."""
        head = np.flatnonzero(rows.head)
        slot = self.program.slot[rows.move[head]]
        self._omitted(rows, head, slot)
        placing = Placing(self.program.data, self.words.number[:], self.words.end[:])
        new: dict[int, tuple[int, int, int]] = {}
        for axis in range(3):
            stated = np.flatnonzero(slot[:, axis] >= 0)
            for row, word in zip(head[stated].tolist(), slot[stated, axis].tolist(), strict=True):
                self._share(rows, new, row, axis, word)
        changes: list[Replacement] = []
        for word, (row, axis, _) in new.items():
            if rows.write[row, axis]:
                start, end = int(self.words.number[word]), int(self.words.end[word])
                changes.append((start, end, self._number(rows, row, axis, word)))
        self.tally.changed_words = len(changes)
        return placing.placed(changes)

    def _insertions(self, rows: Rows) -> list[Replacement]:
        """Later parts of a move that was split: its statement again, with other numbers."""
        insertions: list[Replacement] = []
        for row in np.flatnonzero(~rows.head).tolist():
            move = int(rows.move[row])
            begin, end = int(self.statements.begin[move]), int(self.statements.end[move])
            line = int(self.path.line[move])
            edits = []
            for axis in range(3):
                word = int(self.program.slot[move, axis])
                start, stop = int(self.words.number[word]) - begin, int(self.words.end[word]) - begin
                edits.append((start, stop, self._number(rows, row, axis, word)))
            text = self.program.eol(line) + spliced(self.program.data[begin:end], edits)
            place = self._line_end(end)
            insertions.append((place, place, text))
            self.tally.inserted_blocks += 1
        return insertions

    def _line_end(self, position: int) -> int:
        """The end of the line of a byte: what is inserted comes behind a comment."""
        ends = self.program.line_end[:]
        return int(ends[min(int(np.searchsorted(ends, position)), len(ends) - 1)])

    def _share(
        self, rows: Rows, new: dict[int, tuple[int, int, int]], row: int, axis: int, word: int
    ) -> None:
        """All moves that share a number have to need the same value of it."""
        mantissa = int(rows.mantissa[row, axis])
        before = new.setdefault(word, (row, axis, mantissa))
        if before[2] != mantissa:
            line, other = (int(self.path.line[rows.move[r]]) for r in (row, before[0]))
            raise ProgramError(
                f"this position serves line {other} too, where its correction differs (another tool, or "
                "another direction of approach); state the position separately for each move",
                line=line,
                code="OLP561",
            )

    def _omitted(self, rows: Rows, head: Index, slot: npt.NDArray[np.int32]) -> None:
        """Raise ProgramError where a statement omits an axis that needs a correction: no word is inserted."""
        stated = (slot >= 0).any(axis=1)
        lost = np.flatnonzero((rows.write[head] & (slot < 0)).any(axis=1) & stated)
        if lost.size:
            line = int(self.path.line[rows.move[head[lost[0]]]])
            raise ProgramError(
                "the correction needs an axis that this statement leaves out; state X, Y and Z in it",
                line=line,
                code="OLP561",
            )

    def _number(self, rows: Rows, row: int, axis: int, word: int) -> bytes:
        start, end = int(self.words.number[word]), int(self.words.end[word])
        form = number(self.program.data[start:end], self.statements.decimal)
        if not isinstance(form, Number):
            raise ProgramError(
                f"the number {self.program.data[start:end].decode('latin-1')[:30]} is larger than a machine; "
                "correct it",
                line=int(self.path.line[rows.move[row]]),
                code="OLP561",
            )
        decimals = int(rows.decimals[row, axis])
        value = int(rows.mantissa[row, axis]) / 10.0**decimals
        return written(form, value, max(decimals, form.decimals), self.statements.decimal)
