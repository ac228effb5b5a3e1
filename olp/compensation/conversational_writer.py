"""Writes a plan back into blocks that say in words what they are: L, C about a pole CC, CR, CP."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from olp.compensation.digits import AxisRows
from olp.compensation.hole_levels import Surfaces
from olp.compensation.plan import Plan
from olp.compensation.pole_arcs import PoleArcs, PoleWriter
from olp.compensation.rows import Rows
from olp.compensation.writer import Task
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.progress import Progress, silent
from olp.core.toolpath import Flag
from olp.program.bands import Band
from olp.program.heidenhain.chunk import LATE_M
from olp.program.program import Definitions
from olp.program.text.edits import BARE, EditList, Edits

#: words that show whether numbers are written with a plus
_LOOKED_AT = 4000


class ConversationalWriter(PoleWriter):
    """A writer of conversational blocks. A later part of a move is a block of its own with the number, R0 and
    FMAX of the first one; holes of cycles have the words of the move before them."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._arcs = PoleArcs()
        self._surfaces = Surfaces()
        self._defined = EditList(self.prefixes)
        slot = self.program.slot[self.program.slot >= 0][:_LOOKED_AT]
        self._signed = self.blocks.signed(slot)

    def add(self, band: Band, plan: Plan, tell: Progress = silent) -> None:
        self.moves_before = band.first
        super().add(band, plan, tell)

    def _spans(self) -> list[tuple[int, int]]:
        """A hole belongs to the move before it."""
        spans = super()._spans()
        cycle = (self.path.flag & np.uint8(Flag.CYCLE)) != 0
        joined = spans[:1]
        for first, last in spans[1:]:
            if cycle[self.plan.move[first]]:
                joined[-1] = (joined[-1][0], last)
            else:
                joined.append((first, last))
        return joined

    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        self._defined = EditList(self.prefixes)
        columns, polar = self._columns(rows), self._arcs.polar(self, rows)
        for a, b in pairwise(self._breaks(rows)):
            if rows.flag[a] & np.uint8(Flag.CYCLE):
                self._cycles(rows, a, b)
            elif polar[a]:
                self._arcs.enter(self, rows, a, b)
            else:
                self._digits(rows, columns, a, b)
        self._arcs.lift(self, rows)
        edits = [*self._word_edits(rows), *self._arcs.edits(self, rows), self._defined.done()]
        return self._spliced(edits, begin, end)

    def _breaks(self, rows: Rows) -> list[int]:
        """Rows at which strokes of cycles, or arcs that do not state their ends, begin and end."""
        apart = (rows.flag & np.uint8(Flag.CYCLE)).astype(np.int64) + 256 * self._arcs.polar(self, rows)
        changes = np.flatnonzero(apart[1:] != apart[:-1]) + 1
        return [0, *changes.tolist(), len(rows.move)]

    def _columns(self, rows: Rows) -> list[AxisRows]:
        """The columns of `BlockWriter`, with positions of holes as the middle of their strokes needs them. A
        cycle that counts from the present height begins where its bottom is right."""
        columns = super()._columns(rows)
        strokes, which, definitions = self._strokes(rows)
        if not len(which):
            return columns
        # the last row of the move to the hole
        top, bottom = (np.searchsorted(rows.move, strokes[:, k], "right") - 1 for k in (0, 1))
        by_height = np.isnan(definitions.surface[which])
        for axis in range(3):
            command, nominal = columns[axis].command, columns[axis].nominal
            away = np.nan_to_num(command - nominal)
            # the stroke begins at the row before its bottom
            middle = (away[bottom - 1] + away[bottom]) / 2 if axis < 2 else away[bottom]
            middled = command.copy()
            middled[top] += (middle - away[top]) * (by_height if axis == 2 else 1.0)
            columns[axis] = replace(columns[axis], command=middled)
        return columns

    def _strokes(self, rows: Rows) -> tuple[Index, Index, Definitions]:
        """(k, 2) the strokes among rows as moves of the band, their numbers, and all definitions."""
        statements = self.program.statements
        assert statements is not None and statements.definitions is not None
        strokes = statements.strokes - self.moves_before
        low, high = np.searchsorted(strokes[:, 0], (rows.move[0], rows.move[-1] + 1))
        return strokes[low:high], np.arange(low, high), statements.definitions

    def _cycles(self, rows: Rows, a: int, b: int) -> None:
        """Strokes a..b are where the move before them left the tool. Their heights are those of the cycle,
        which is defined again where its surface has to be another one."""
        before, path = rows.emitted[a - 1] if a else rows.entry, self.path
        last = int(rows.move[a - 1]) if a else int(rows.move[a]) - 1
        nominal = path.end_mm[last, 2] if last >= 0 else path.start_mm[2]
        rows.emitted[a:b] = path.end_mm[rows.move[a:b]]
        rows.emitted[a:b, :2] = before[:2]
        strokes, which, definitions = self._strokes(rows)
        for (_, bottom), k in zip(strokes.tolist(), which.tolist(), strict=True):
            row = int(rows.move.searchsorted(bottom))
            if not a < row < b:
                continue
            if np.isnan(definitions.surface[k]):
                # it begins at the height where the tool is
                lift = float(before[2] - nominal)
            else:
                lift = self._surfaced(rows, row, k)
            rows.emitted[row - 1 : row + 2, 2] += lift

    def _surfaced(self, rows: Rows, row: int, stroke: int) -> float:
        """How much higher a hole is than the program says; defines its cycle again where that changes."""
        move = int(rows.move[row])
        unit = float(self.frame_unit_mm[self.path.frame[move]])
        away = float(self.plan.command_mm[rows.first + row, 2] - self.path.end_mm[move, 2]) / unit
        line, decimals = int(self.path.line[move]), self.style.usual(2, unit)
        made, tally = self._defined, self.tally
        return unit * self._surfaces.lift(self.program, stroke, line, away, decimals, made, tally)

    def _spliced(self, edits: list[Edits], begin: int, end: int) -> bytes | None:
        """Numbers that stay positive keep their plus, and new ones get one where the program writes it."""
        text = np.frombuffer(self.program.data, np.uint8)
        last = len(text) - 1
        for k, e in enumerate(edits):
            if self._signed:
                new = (e.end == e.start) & (e.mantissa >= 0)
                prefix = e.prefix.copy()
                for p in distinct(prefix[new]).tolist():
                    prefix[new & (e.prefix == p)] = self.prefixes(self.prefixes.table[p] + b"+")
                e = edits[k] = replace(e, prefix=prefix)
            plus = (e.end > e.start) & (text[np.minimum(e.start, last)] == ord("+")) & (e.mantissa >= 0)
            if plus.any():
                edits[k] = replace(e, start=np.where(plus, e.start + 1, e.start))
        return super()._spliced(edits, begin, end)

    # -- words and blocks ----------------------------------------------------------------------------

    def _insertions(self, rows: Rows, row: Index, slot: Array, missing: Mask) -> list[Edits]:  # type: ignore[override]
        """Words that a block omits: distances in a block of distances."""
        step = (rows.flag[row] & np.uint8(Flag.INCREMENTAL)) != 0
        edits: list[Edits] = []
        for letters, mine in (((b"X", b"Y", b"Z"), ~step), ((b"IX", b"IY", b"IZ"), step)):
            if mine.any():
                self.letters = letters
                edits += super()._insertions(rows, row[mine], slot[mine], missing[mine])
        return edits

    def _blocks(self, rows: Rows, tails: Index) -> list[Edits]:
        straight = tails[~rows.arc[tails] | rows.take_up[tails]]
        edits: list[Edits] = []
        if straight.size:
            edits += self._lines(rows, straight)
        late = EditList(self.prefixes)
        self._late(rows, tails[~rows.before[tails]], late)
        return [*edits, late.done()]

    def _lines(self, rows: Rows, tails: Index) -> list[Edits]:
        """L blocks for the later parts of straight moves, and for steps before arcs."""
        program, prefixes = self.program, self.prefixes
        line = self.path.line[rows.move[tails]]
        before = rows.before[tails]
        place = np.where(before, program.line_start[line - 1], program.line_end[line - 1]).astype(np.int64)
        write = rows.write[tails]
        some = write.any(axis=1)
        # a part whose rounded end is where it began needs no block
        np.subtract.at(self.parts, rows.move[tails[~some]], 1)
        lines, which = np.unique(line, return_inverse=True)
        lead = np.array([prefixes(self.blocks.lead(n)) for n in lines.tolist()])[which]
        trail = np.array([prefixes(self.blocks.trail(n)) for n in lines.tolist()])[which]
        ahead = np.flatnonzero(before & some)
        for k in ahead.tolist():
            n = int(line[k])
            lead[k] = prefixes(self.blocks.lead(n)[len(program.eol(n)) :])
            trail[k] = prefixes(self.blocks.trail(n) + self._feed(n) + program.eol(n))
        step = (rows.flag[tails] & np.uint8(Flag.INCREMENTAL)) != 0
        order = tails * 8 + 16
        begun = np.zeros(len(tails), bool)
        edits: list[Edits] = []
        for axis in range(3):
            mine = np.flatnonzero(write[:, axis])
            letters = (b" " + b"XYZ"[axis : axis + 1], b" I" + b"XYZ"[axis : axis + 1])
            prefix = np.where(step[mine], prefixes(letters[1]), prefixes(letters[0]))
            for k in np.flatnonzero(~begun[mine]).tolist():
                text = prefixes.table[int(lead[mine[k]])] + b"L"
                prefix[k] = prefixes(text + letters[int(step[mine[k]])])
            begun[mine] = True
            row = tails[mine]
            edits.append(
                Edits.of(
                    place[mine], place[mine], rows.mantissa[row, axis], rows.decimals[row, axis], prefix,
                    order[mine] + axis,
                )
            )  # fmt: skip
        kept = np.flatnonzero(some)
        edits.append(
            Edits.of(place[kept], place[kept], np.full(len(kept), BARE), 0, trail[kept], order[kept] + 3)
        )
        self.tally.inserted_blocks += int(some.sum())
        return edits

    def _feed(self, line: int) -> bytes:
        """The F word of a block, for the block that is put before it."""
        words = self.words
        for i in words.of_line(line):
            if words.letter[i] == ord("F") and words.mantissa[i] >= 0:
                return b" " + self.program.data[int(words.start[i]) : int(words.end[i])]
        return b""

    def _late(self, rows: Rows, tails: Index, edits: EditList) -> None:
        """M functions that act at the end of a block go from its first part to its last."""
        words = self.words
        for line in distinct(self.path.line[rows.move[tails]]).tolist():
            for i in words.of_line(line):
                if words.letter[i] == ord("M") and int(words.mantissa[i]) in LATE_M and not words.decimals[i]:
                    place = int(self.program.line_end[line - 1])
                    start, end = int(words.start[i]), int(words.end[i])
                    edits.add(start, end, BARE, 0)
                    edits.add(place, place, BARE, 0, b" " + self.program.data[start:end], 2**30 + i)
