"""Writes a plan back into a program of blocks of words (RS-274): words changed and inserted, blocks inserted,
nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.compensation.block_arcs import arc_edits
from olp.compensation.called_holes import CalledHoles, joined
from olp.compensation.digits import AxisRows, part_of
from olp.compensation.inserted_blocks import block_edits
from olp.compensation.plan import Plan
from olp.compensation.rows import Rows
from olp.compensation.shared_words import shared_edits
from olp.compensation.stretches import Decimals, Stretches, digits_of
from olp.compensation.writer import Task, Writer
from olp.core.arrays import Index, Mask, any_in_row, distinct, most_in_row
from olp.core.progress import Progress, silent
from olp.core.toolpath import Flag
from olp.core.turns import Turns
from olp.program.bands import Band
from olp.program.text.edits import EditList, Edits

if TYPE_CHECKING:
    from olp.compensation.holes import HoleWords
    from olp.program.rs274.state import Capture

#: Moves whose words are not those of their end point.
_BYPASS = np.uint8(Flag.CYCLE | Flag.CONTROL)


class BlockWriter(Writer):
    """A writer of blocks, whose words may be omitted: per axis, what is written and what is inserted.
    `letters` are those of inserted words."""

    letters = (b"X", b"Y", b"Z")

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._called_holes = CalledHoles()
        self._hole_words: HoleWords | None = None

    def _spans(self) -> list[tuple[int, int]]:
        return joined(self.program.called, self.plan.move, super()._spans())

    def add(self, band: Band, plan: Plan, tell: Progress = silent) -> None:
        self._hole_words = None
        if len(band.program.holes):
            from olp.compensation.holes import HoleWords

            self._hole_words = HoleWords(band.program.holes)
        self._next_capture = 0
        super().add(band, plan, tell)

    def _rewritten(self, rows: Rows, begin: int, end: int) -> bytes | None:
        edits: list[Edits] = []
        columns = self._called_holes.middled(self, rows, self._columns(rows))
        if self._hole_words is not None:
            for part in self._hole_words.parts(self, rows, self._turns(rows)):
                if part.first < part.last:
                    edits += self._hole_words.edits(self, rows, part, columns)
                else:
                    self._digits(rows, columns, part.a, part.b)
        else:
            for a, b in pairwise(self._breaks(rows)):
                if rows.flag[a] & np.uint8(Flag.CYCLE):
                    edits.append(self._called_holes.edits(self, rows, a, b))
                else:
                    self._digits(rows, columns, a, b)
        self._after_block_delete(rows)
        edits += [*self._word_edits(rows), *arc_edits(self, rows), *shared_edits(self, rows)]
        edits += self._captures(rows)
        return self._spliced(edits, begin, end)

    def _turns(self, rows: Rows) -> Index:
        """The rows at which words begin to turn otherwise."""
        if self.turns is None:
            return np.zeros(0, np.int64)
        turn = self.turn_of(rows)
        return np.flatnonzero(turn[1:] != turn[:-1]) + 1

    def _breaks(self, rows: Rows) -> list[int]:
        """The rows at which holes that blocks call begin and end, and words turn otherwise."""
        cycle = (rows.flag & np.uint8(Flag.CYCLE)) != 0
        changes = np.flatnonzero(cycle[1:] != cycle[:-1]) + 1
        every = distinct(np.concatenate((changes, self._turns(rows))))
        return [0, *every.tolist(), len(rows.move)]

    def _columns(self, rows: Rows) -> list[AxisRows]:
        """Per axis of the words, what its digits are made from."""
        path, words = self.path, self.words
        part = slice(rows.first, rows.first + len(rows.move))
        frame = path.frame[rows.move]
        one = len(frame) > 0 and bool((frame == frame[0]).all())
        unit = self.frame_unit_mm[frame[:1]] if one else self.frame_unit_mm[frame]
        same_unit = bool((unit == unit[:1]).all())
        reset = self._set_by_control(rows)
        offset = self.word_offset_mm[frame[0]] if one else self.word_offset_mm[frame]
        command, ends, columns = self.plan.command_mm[part], path.end_mm[rows.move], []
        if self.turns is not None:
            turn = self.turn_of(rows)
            command, ends = self.turns.words(command, turn), self.turns.words(ends, turn)
        for axis in range(3):
            nominal = ends[:, axis]
            slot = np.where(rows.head, self.program.slot[rows.move, axis], -1)
            given = slot >= 0
            columns.append(
                AxisRows(
                    command=command[:, axis],
                    nominal=nominal,
                    given=given,
                    raw=self.plan.raw[part, axis],
                    reset=reset[:, axis],
                    word=np.where(given, words.mantissa[slot], 0),
                    decimals=np.where(given, self.style.decimals(slot, axis, unit), 0).astype(np.int8),
                    offset=float(offset[axis]) if one else offset[:, axis],
                    unit=float(unit[0]) if same_unit else unit,
                )
            )
        return columns

    def _set_by_control(self, rows: Rows) -> Mask:
        """(r, 3) axes whose position the control loses or finds by itself."""
        control = (rows.flag & np.uint8(Flag.CONTROL)) != 0
        reset = np.zeros((len(control), 3), bool)
        if control.any():
            move, path = rows.move[control], self.path
            begin = path.end_mm[np.maximum(move - 1, 0)]
            begin[move == 0] = path.start_mm
            reset[control] = np.isnan(path.end_mm[move]) | np.isnan(begin)
        return reset

    def _digits(self, rows: Rows, columns: list[AxisRows], a: int, b: int) -> None:
        """Digits of rows a..b, which no canned cycle makes."""
        counting = (rows.flag[a:b] & np.uint8(Flag.INCREMENTAL)) != 0
        stretches = Stretches.of(counting, part_of(columns[0].unit, slice(a, b)))
        turn = int(self.turn_of(rows)[a]) if self.turns is not None else 0
        entry = self.along_words((rows.emitted[a - 1] if a else rows.entry)[None], turn)[0]
        for axis, column in enumerate(columns):
            before = float(entry[axis])
            part = column.part(slice(a, b))
            digits = digits_of(part, stretches, before, Decimals.of(self.style, axis, part.unit))
            rows.put(slice(a, b), axis, digits)
        if turn:
            rows.emitted[a:b] = self.along_axes(rows.emitted[a:b], turn)

    def _after_block_delete(self, rows: Rows) -> None:
        """The first block after `/` blocks must not rely on a word that was inserted in them."""
        deleted = (rows.flag & np.uint8(Flag.DELETED)) != 0
        if not deleted.any():
            return
        ends = np.flatnonzero(deleted[:-1] & ~deleted[1:]) + 1
        for row in ends.tolist():
            begin = row - 1
            while begin >= 0 and deleted[begin]:
                begin -= 1
            before = rows.emitted[begin] if begin >= 0 else rows.entry
            places = np.array([before, rows.emitted[row - 1], rows.emitted[row]])
            before, after, place = self.along_words(places, int(self.turn_of(rows)[row]))
            nominal_moved = self._nominal_moved(rows, begin, row)
            for axis in range(3):
                moved = not abs(after[axis] - before[axis]) < 1e-9
                given = rows.head[row] and self.program.slot[rows.move[row], axis] >= 0
                if not moved or given or np.isnan(place[axis]):
                    continue
                if nominal_moved[axis] or rows.flag[row] & np.uint8(Flag.INCREMENTAL):
                    continue
                self._force(rows, row, axis, float(place[axis]))

    def _nominal_moved(self, rows: Rows, begin: int, row: int) -> list[bool]:
        """Which words would be others behind the deleted blocks before a row, as the program says."""
        end, first = self.path.end_mm, int(rows.move[begin + 1])
        places = np.array([end[first - 1] if first else self.path.start_mm, end[rows.move[row - 1]]])
        before, after = self.along_words(places, int(self.turn_of(rows)[row]))
        return [not abs(b - a) < 1e-9 for a, b in zip(before.tolist(), after.tolist(), strict=True)]

    def _force(self, rows: Rows, row: int, axis: int, place: float) -> None:
        frame = int(self.path.frame[rows.move[row]])
        unit, offset = float(self.frame_unit_mm[frame]), float(self.word_offset_mm[frame, axis])
        decimals = self.style.usual(axis, unit)
        rows.mantissa[row, axis] = round((place - offset) / unit * 10**decimals)
        rows.decimals[row, axis] = decimals
        rows.write[row, axis] = True

    # -- edits -------------------------------------------------------------------------------------

    def _word_edits(self, rows: Rows) -> list[Edits]:
        """Replaced and inserted axis words of the blocks that are there, and inserted blocks."""
        program, words = self.program, self.words
        edits: list[Edits] = []
        head = np.flatnonzero(rows.head & ((rows.flag & _BYPASS) == 0))
        slot = program.slot[rows.move[head]]
        write = rows.write[head]
        for axis in range(3):
            mine = slot[:, axis]
            replace = np.flatnonzero(write[:, axis] & (mine >= 0))
            index = mine[replace]
            edits.append(
                Edits(
                    words.number[index].astype(np.int64),
                    words.end[index].astype(np.int64),
                    rows.mantissa[head[replace], axis],
                    rows.decimals[head[replace], axis],
                    np.zeros(len(replace), np.int32),
                    np.zeros(len(replace), np.int32),
                )
            )
            self.tally.changed_words += len(replace)
        missing = write & (slot < 0)
        incomplete = np.flatnonzero(any_in_row(missing))
        if incomplete.size:
            edits += self._insertions(rows, head[incomplete], slot[incomplete], missing[incomplete])
        tails = np.flatnonzero(~rows.head & ((rows.flag & _BYPASS) == 0))
        if tails.size:
            edits += self._blocks(rows, tails)
        return edits

    def _blocks(self, rows: Rows, tails: Index) -> list[Edits]:
        """New blocks for the later parts of moves."""
        return block_edits(self, rows, tails)

    def _insertions(self, rows: Rows, row: Index, slot: npt.NDArray[np.int32], missing: Mask) -> list[Edits]:
        """Words of axes that a block omits, behind its last coordinate word, in that word's style."""
        words = self.words
        ends = np.where(slot >= 0, words.end[slot], -1)
        place = most_in_row(ends).astype(np.int64)
        last = np.take_along_axis(slot, ends.argmax(axis=1)[:, None], axis=1)[:, 0]
        none = np.flatnonzero(place < 0)
        for i in none.tolist():
            line = int(self.path.line[rows.move[row[i]]])
            last[i] = self.style.last_word(line)
            place[i] = words.end[last[i]]
        style = self.style.separators(last, self.program)
        edits = []
        for axis in range(3):
            for which in distinct(style[missing[:, axis]]).tolist():
                chosen = np.flatnonzero(missing[:, axis] & (style == which))
                prefix = self.prefixes(self.style.separator(which, self.letters[axis]))
                count = len(chosen)
                order = np.full(count, axis + 1, np.int32)
                edits.append(
                    Edits(
                        place[chosen], place[chosen], rows.mantissa[row[chosen], axis],
                        rows.decimals[row[chosen], axis], np.full(count, prefix, np.int32), order,
                    )
                )  # fmt: skip
                self.tally.inserted_words += count
        return edits

    def _captures(self, rows: Rows) -> list[Edits]:
        """Words that store the present position (G92, G10 L20) move with the correction of that position."""
        edits = EditList(self.prefixes)
        captures, begin = self.program.captures, self._next_capture
        final = rows.first + len(rows.move) == len(self.plan)
        while self._next_capture < len(captures):
            if captures[self._next_capture].moves > int(rows.move[-1]) + 1 and not final:
                break
            self._next_capture += 1
        chosen = captures[begin : self._next_capture]
        word = np.array([capture.word for capture in chosen], np.int64)
        axis = np.array([capture.axis for capture in chosen], np.int64)
        columns = (
            self.words.number[word], self.words.end[word], self.words.mantissa[word],
            self.style.decimals(word, axis, np.array([c.unit_mm for c in chosen])),
        )  # fmt: skip
        away_mm = self._moved_mm(rows, chosen)
        for k, (start, end, own, written) in enumerate(zip(*(c.tolist() for c in columns), strict=True)):
            capture = chosen[k]
            digits = max(self.style.grid(capture.axis, capture.unit_mm), written)
            before = own * 10 ** (digits - written)
            new = before + round(away_mm[k] / capture.unit_mm * 10**digits)
            if new != before:
                edits.add(start, end, new, digits)
                self.tally.changed_words += 1
        return [edits.done()]

    def _moved_mm(self, rows: Rows, captures: Sequence[Capture]) -> list[float]:
        """By how much the written position is off the nominal one where each word stores it, along its
        axis."""
        moves = np.array([capture.moves for capture in captures], np.int64)
        row = rows.move.searchsorted(moves)
        away = np.vstack((rows.entry, rows.emitted)).take(row, axis=0)
        # before the first move nothing is corrected
        away[moves == 0] = 0.0
        away[moves > 0] -= self.path.end_mm[moves[moves > 0] - 1]
        for k, capture in enumerate(captures):
            if capture.turn is not None:
                turns = Turns.of([capture.turn])
                assert turns is not None
                away[k] = turns.words(away[k][None], 1)[0]
        axis = np.array([capture.axis for capture in captures], np.int64)
        moved: list[float] = away[np.arange(len(axis)), axis].tolist()
        return moved
