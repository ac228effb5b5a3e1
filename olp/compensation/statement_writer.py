"""Writes a plan back into a program of whole statements (APT, DMIS, plain lists): numbers changed, statements
inserted, nothing else."""

from __future__ import annotations

import numpy as np

from olp.compensation.point_writer import PointWriter
from olp.compensation.rows import Rows
from olp.compensation.statement_arcs import ROW, arc_edits
from olp.compensation.statement_chords import chord_edits
from olp.compensation.wrapping import card_stamp, carded, wrapped
from olp.compensation.writer import Task
from olp.core.arrays import Index
from olp.core.toolpath import Kind
from olp.core.units import MM_PER_INCH
from olp.program.text.edits import BARE, EditList, Edits


class StatementWriter(PointWriter):
    """A writer of statements that go on in the next line where they are long, and of their arcs."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._broken = np.array(sorted(self.statements.broken), np.int64)
        self._begins = {arc.first: arc.begin for arc in self.statements.chords}
        if self.statements.cards:
            self.stamp = card_stamp(self.stamp, self.statements.width)

    def _start_of(self, move: int) -> int:
        """What states an arc comes before its end point, and belongs to the move too."""
        arc = self.statements.arcs.get(move)
        begin = min(super()._start_of(move), self._begins.get(move, len(self.program.data)))
        return begin if arc is None else min(begin, arc.begin)

    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        self._digits(rows)
        edits = [*self._changes(rows), *self._insertions(rows), *arc_edits(self, rows)]
        if self.chorded.size:
            edits += chord_edits(self, rows)
        text = self._spliced(edits, begin, end)
        if text is None:
            return None
        lines = carded if self.statements.cards else wrapped
        return lines(text, self.statements.width, self.statements.mark)

    def _least(self, axis: int, unit_mm: float) -> int:
        return super()._least(axis, unit_mm if unit_mm == 1.0 else MM_PER_INCH)

    def _changes(self, rows: Rows) -> list[Edits]:
        """Numbers of the statements that are there."""
        slot = self.program.slot[rows.move]
        change = rows.write & rows.head[:, None]
        short = (slot[:, 2] >= 0) & (slot[:, 0] < 0)
        edits = [*self._spelled(rows, np.flatnonzero(short & change[:, :2].any(axis=1)))]
        change[short & change[:, :2].any(axis=1)] = False
        row, axis = np.nonzero(change & (slot >= 0))
        word = slot[row, axis]
        prefix = np.zeros(len(word), np.int32)
        if self._broken.size:
            for k in np.flatnonzero(np.isin(word, self._broken)).tolist():
                prefix[k] = self.prefixes(self.statements.broken[int(word[k])])
        edits.append(
            Edits(
                self.words.number[word].astype(np.int64), self.words.end[word].astype(np.int64),
                rows.mantissa[row, axis], rows.decimals[row, axis], prefix, np.zeros(len(word), np.int32),
            )
        )  # fmt: skip
        self.tally.changed_words += len(word)
        return edits

    def _spelled(self, rows: Rows, which: Index) -> list[Edits]:
        """One distance along the tool axis becomes three, where the others change too."""
        edits = EditList(self.prefixes)
        for row in which.tolist():
            word = int(self.program.slot[rows.move[row], 2])
            start, end = int(self.words.number[word]), int(self.words.end[word])
            for axis in range(3):
                place = (start, end) if axis == 0 else (end, end)
                mantissa, decimals = int(rows.mantissa[row, axis]), int(rows.decimals[row, axis])
                edits.add(*place, mantissa, decimals, b"" if axis == 0 else b",", order=axis)
            self.tally.changed_words += 1
            self.tally.inserted_words += 2
        return [edits.done()]

    def _insertions(self, rows: Rows) -> list[Edits]:
        """Later parts of straight moves: the statement again, with other numbers."""
        some = ~rows.head & rows.write.any(axis=1) & (~rows.arc | rows.take_up)
        tails = np.flatnonzero(some & ~np.isin(rows.move, self.chorded))
        if not tails.size:
            return []
        moves, which = np.unique(rows.move[tails], return_inverse=True)
        pieces = np.zeros((len(moves), 4), np.int64)
        place = np.zeros((len(moves), 2), np.int64)
        for i, move in enumerate(moves.tolist()):
            lead, between, last, trail = self.template(move)
            eol = self.program.eol(int(self.path.line[move]))
            pieces[i] = [self.prefixes(p) for p in (eol + lead, between, last, trail)]
            place[i] = self.statements.end[move], self._start_of(move)
        edits = []
        ahead = rows.before[tails]
        position = np.where(ahead, place[which, 1], place[which, 0])
        order = (tails * ROW).astype(np.int32)
        zero = np.zeros(len(tails), np.int8)
        bare = np.full(len(tails), BARE)
        lead = pieces[which, 0]
        if ahead.any():
            # in front of an arc the line end comes behind
            for k in np.flatnonzero(ahead).tolist():
                text = self.prefixes.table[int(lead[k])]
                lead[k] = self.prefixes(text.lstrip(b"\r\n"))
        for axis in range(3):
            prefix = lead if axis == 0 else pieces[which, axis]
            edits.append(
                Edits(
                    position, position, rows.mantissa[tails, axis], rows.decimals[tails, axis],
                    prefix.astype(np.int32), order + np.int32(axis),
                )
            )  # fmt: skip
        trailing = pieces[which, 3].astype(np.int32)
        edits.append(Edits(position, position, bare, zero, trailing, order + np.int32(3)))
        ends = [self.prefixes(self.program.eol(int(self.path.line[m]))) for m in moves.tolist()]
        behind = np.flatnonzero(ahead)
        closing = np.array(ends, np.int32)[which[behind]]
        edits.append(
            Edits(
                position[behind], position[behind], bare[behind], zero[behind], closing,
                order[behind] + np.int32(4),
            )
        )  # fmt: skip
        self.tally.inserted_blocks += len(tails)
        return edits

    def template(self, move: int) -> tuple[bytes, bytes, bytes, bytes]:
        """The statement of a move without its three numbers: the text before, between and behind them.
        A comment at its end, and marks of continuation inside its words, are left out."""
        data, statements = self.program.data, self.statements
        slot = self.program.slot[move]
        begin, end = int(statements.begin[move]), int(statements.end[move])
        words = [s for s in slot.tolist() if s >= 0]
        start = [int(self.words.number[s]) for s in words]
        stop = [int(self.words.end[s]) for s in words]
        arc = statements.arcs.get(move)
        if arc is not None and arc.whole:
            return b"GOTO/", b",", b",", b""
        lead = data[begin : start[0]]
        if len(words) == 3:
            between, last = data[stop[0] : start[1]], data[stop[1] : start[2]]
        else:
            between = last = b","
        trail = data[stop[-1] : end]
        comment = trail.find(b"$$")
        if comment >= 0:
            trail = trail[:comment].rstrip()
        if self.path.kind[move] == Kind.RAPID:
            lead = statements.rapid + self.program.eol(int(self.path.line[move])) + lead
        return lead, between, last, trail
