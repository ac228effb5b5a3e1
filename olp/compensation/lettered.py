"""Writes a plan back into lists and described languages: numbers in their own form and column, and copies of
a statement where its move is split."""

from __future__ import annotations

import numpy as np

from olp.compensation.rows import Rows
from olp.compensation.stamp import stamped
from olp.compensation.style import Slots
from olp.compensation.writer import Index, Writer
from olp.exceptions import ProgramError
from olp.program.edits import Edits
from olp.program.numbertext import Number, Placing, number, spliced, written
from olp.program.program import Lettering


class LetteredWriter(Writer):
    """As `Writer`, for programs with a `lettering`. Every move says all three axes, or none of the text
    does."""

    def text(self) -> bytes:
        self._replaced: list[tuple[int, int, bytes]] = []
        if len(self.plan):
            self._edits(0, len(self.plan))
        if not self._replaced:
            return self.program.data
        text = spliced(self.program.data, self._replaced)
        return stamped(text, self.stamp, self.program.eol(1)) if self.stamp else text

    @property
    def lettering(self) -> Lettering:
        found = self.program.lettering
        assert found is not None
        return found

    def _word_edits(self, rows: Rows) -> list[Edits]:
        head = np.flatnonzero(rows.head)
        slot = self.program.slot[rows.move[head]]
        self._omitted(rows, head, slot)
        placing = Placing(self.program.data, self.words.number, self.words.end)
        new: dict[int, tuple[int, int, int]] = {}
        for axis in range(3):
            said = np.flatnonzero(slot[:, axis] >= 0)
            for row, word in zip(head[said].tolist(), slot[said, axis].tolist(), strict=True):
                self._share(rows, new, row, axis, word)
        for word, (row, axis, _) in new.items():
            start, end = int(self.words.number[word]), int(self.words.end[word])
            if rows.write[row, axis]:
                self._replaced.append(placing.place(start, end, self._number(rows, row, axis, word)))
        self.tally.changed_words = len(self._replaced)
        tails = np.flatnonzero(~rows.head)
        for row in tails.tolist():
            self._copy(rows, row)
        counts = np.bincount(rows.move - rows.move[0])
        self.parts[rows.move[0] : rows.move[-1] + 1] += counts.astype(np.int32)
        self.tally.inserted_blocks = len(tails)
        return []

    def _share(
        self, rows: Rows, new: dict[int, tuple[int, int, int]], row: int, axis: int, word: int
    ) -> None:
        """One number may be that of several moves: then all of them have to want the same of it."""
        mantissa = int(rows.mantissa[row, axis]) if rows.write[row, axis] else int(self.words.mantissa[word])
        before = new.setdefault(word, (row, axis, mantissa))
        if before[2] != mantissa:
            line, other = (int(self.path.line[rows.move[r]]) for r in (row, before[0]))
            raise ProgramError(
                f"this position is that of line {other} too, and the correction differs between them (by "
                "tool "
                "or by the way that the machine comes from); give each move a position of its own",
                line=line,
            )

    def _omitted(self, rows: Rows, head: Index, slot: Slots) -> None:
        """No word is put where a statement says nothing of an axis: what it needed would be lost."""
        lost = np.flatnonzero((rows.write[head] & (slot < 0)).any(axis=1))
        if lost.size:
            line = int(self.path.line[rows.move[head[lost[0]]]])
            raise ProgramError(
                "the correction needs an axis that this statement leaves out; state X, Y and Z in it",
                line=line,
            )

    def _form(self, word: int) -> Number:
        start, end = int(self.words.number[word]), int(self.words.end[word])
        found = number(self.program.data[start:end], self.lettering.decimal)
        assert found is not None
        return found

    def _number(self, rows: Rows, row: int, axis: int, word: int) -> bytes:
        mantissa, decimals = int(rows.mantissa[row, axis]), int(rows.decimals[row, axis])
        form = self._form(word)
        if not form.letter and form.decimals > decimals:
            decimals, mantissa = form.decimals, mantissa * 10 ** (form.decimals - decimals)
        return written(form, mantissa / 10.0**decimals, decimals, self.lettering.decimal)

    def _copy(self, rows: Rows, row: int) -> None:
        """A later part of a move that was split: its statement again, with other numbers."""
        move = int(rows.move[row])
        begin, end = int(self.lettering.begin[move]), int(self.lettering.end[move])
        line = int(self.path.line[move])
        frame = self.frame_of(move)
        edits = []
        for axis in range(3):
            word = int(self.program.slot[move, axis])
            start, stop = int(self.words.number[word]) - begin, int(self.words.end[word]) - begin
            decimals = max(self.style.usual(axis, frame.unit_mm), int(self.words.decimals[word]))
            if rows.write[row, axis]:
                value = float(rows.mantissa[row, axis]) / 10.0 ** int(rows.decimals[row, axis])
            else:
                value = (rows.emitted[row, axis] - frame.offset_mm[axis]) / frame.unit_mm
            edits.append((start, stop, written(self._form(word), value, decimals, self.lettering.decimal)))
        text = self.program.eol(line) + spliced(self.program.data[begin:end], edits)
        at = int(self.program.line_end[line - 1])
        self._replaced.append((at, at, text))
