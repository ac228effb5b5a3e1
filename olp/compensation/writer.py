"""Writes a plan back into the program's own text: changed and inserted words, inserted blocks, nothing else.

Goes through the rows in chunks, so that memory stays small: digits per axis, then edits, then one splice
per chunk of text.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.compensation.arcwords import arc_edits
from olp.compensation.blocks import block_edits
from olp.compensation.digits import AxisRows, absolute, incremental
from olp.compensation.holes import HolePlan, hole_edits
from olp.compensation.plan import Plan, targets
from olp.compensation.rows import Rows
from olp.compensation.stamp import stamped
from olp.compensation.style import Style
from olp.compensation.tally import Tally
from olp.core.arrays import Index, Mask
from olp.core.machine import Vector
from olp.core.toolpath import Flag, Frame, Kind
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.edits import Edits, Prefixes, splice

CHUNK = 1 << 15
_BYPASS = np.uint8(Flag.CYCLE | Flag.CONTROL)


class Writer:
    """One writing of one program. `text()` gives the corrected bytes; `parts` then holds, per move of the
    nominal path, how many moves the corrected text has for it."""

    def __init__(
        self,
        program: Program,
        plan: Plan,
        model: ErrorModel,
        *,
        tolerance_mm: float,
        increments_mm: Vector,
        stamp: bytes = b"",
    ) -> None:
        assert program.words is not None
        self.program, self.plan, self.model = program, plan, model
        self.words = program.words
        self.tolerance_mm = tolerance_mm
        self.stamp = stamp
        self.style = Style.of(program, increments_mm)
        self.prefixes = Prefixes()
        self.tally = Tally()
        self.path = program.toolpath
        self.targets = targets(self.path, plan.shift_mm)
        self.emitted = [float(v) for v in self.path.start_mm]
        self.parts = np.zeros(len(self.path), np.int32)
        self.holes = HolePlan.of(program, plan, model)
        self.hole_of = {m: i for i, hole in enumerate(program.holes) for m in range(hole.first, hole.last)}
        self.series, self.initial = -1, 0.0
        self.sticky: dict[str, float] = {}
        self.next_capture = 0
        self.frames_offset = np.array([f.offset_mm for f in self.path.frames]).reshape(-1, 3)
        self.frames_unit = np.array([f.unit_mm for f in self.path.frames])
        self.changed = False

    def text(self) -> bytes:
        """The corrected text; the program's own bytes where nothing changes."""
        source = np.frombuffer(self.program.data, np.uint8)
        out: list[bytes] = []
        at = 0
        for first, last in self._spans():
            edits = self._edits(first, last)
            to = len(source) if last == len(self.plan) else self._line_start_of_row(last)
            if edits:
                joined = Edits.join(edits)
                text = splice(source[at:to], at, joined, self.prefixes, leading_zero=self.style.leading_zero)
                out.append(text.tobytes())
                self.changed = True
            else:
                out.append(self.program.data[at:to])
            at = to
        out.append(self.program.data[at:])
        if self.changed and self.stamp:
            out[0] = stamped(out[0], self.stamp, self.program.eol(1), self.program.dialect.first)
        return b"".join(out)

    def frame_of(self, move: int) -> Frame:
        return self.path.frames[int(self.path.frame[move])]

    def block_start(self, line: int) -> bytes:
        """What stands before the first word of a block inserted after a line."""
        deleted = self.program.text(line).lstrip().startswith("/")
        return self.program.eol(line) + (b"/" if deleted else b"")

    def _line_start_of_row(self, row: int) -> int:
        return int(self.program.line_start[self.path.line[self.plan.move[row]] - 1])

    def _spans(self) -> list[tuple[int, int]]:
        """Chunks of rows that end between lines."""
        count = len(self.plan)
        cuts = [0]
        lines = self.path.line
        while cuts[-1] < count:
            cut = min(cuts[-1] + CHUNK, count)
            while cut < count and lines[self.plan.move[cut]] == lines[self.plan.move[cut - 1]]:
                cut += 1
            cuts.append(cut)
        return list(pairwise(cuts))

    # -- one chunk ---------------------------------------------------------------------------------

    def _edits(self, first: int, last: int) -> list[Edits]:
        plan, path = self.plan, self.path
        move = plan.move[first:last]
        flag = path.flag[move]
        rows = Rows(
            first=first,
            move=move,
            head=np.concatenate(([True], move[1:] != move[:-1])) if len(move) else np.zeros(0, bool),
            flag=flag,
            emitted=np.empty((last - first, 3)),
            entry=np.array(self.emitted),
            write=np.zeros((last - first, 3), bool),
            mantissa=np.zeros((last - first, 3), np.int64),
            decimals=np.zeros((last - first, 3), np.int8),
        )
        edits: list[Edits] = []
        self._mark_take_ups(rows)
        columns = self._columns(rows)
        for a, b in pairwise(self._breaks(rows)):
            if flag[a] & np.uint8(Flag.CYCLE):
                edits += hole_edits(self, rows, a, b)
            else:
                self._digits(rows, columns, a, b)
        self._after_block_delete(rows)
        edits += self._word_edits(rows)
        edits += arc_edits(self, rows)
        edits += self._captures(rows)
        self.emitted = [float(v) for v in rows.emitted[-1]]
        return [e for e in edits if len(e)]

    def _mark_take_ups(self, rows: Rows) -> None:
        """An arc's first part keeps the block's own line, so lost motion is taken up in a block before it."""
        take_up = self.plan.take_up[rows.first : rows.first + len(rows.move)]
        arc = np.isin(self.path.kind[rows.move], (Kind.ARC_CW, Kind.ARC_CCW))
        rows.before = np.zeros(len(rows.move), bool)
        at = np.flatnonzero(take_up & arc & rows.head)
        while at.size:
            rows.before[at] = True
            rows.head[at] = False
            rows.head[at + 1] = True
            at = at[take_up[at + 1]] + 1

    def _breaks(self, rows: Rows) -> list[int]:
        """Where the way of counting changes: G90 and G91, units, canned cycles."""
        key = (rows.flag & np.uint8(Flag.INCREMENTAL | Flag.CYCLE)).astype(np.int64)
        key += (self.frames_unit[self.path.frame[rows.move]] > 2) * 256
        cycle = (rows.flag & np.uint8(Flag.CYCLE)) != 0
        if cycle.any():
            key = np.where(cycle, -1 - self.path.line[rows.move].astype(np.int64), key)
        changes = np.flatnonzero(key[1:] != key[:-1]) + 1
        return [0, *changes.tolist(), len(rows.move)]

    def _columns(self, rows: Rows) -> list[AxisRows]:
        """Per axis, what its digits are made from."""
        path, words = self.path, self.words
        part = slice(rows.first, rows.first + len(rows.move))
        frame = path.frame[rows.move]
        one = len(frame) > 0 and bool((frame == frame[0]).all())
        unit = self.frames_unit[frame[:1]] if one else self.frames_unit[frame]
        control = (rows.flag & np.uint8(Flag.CONTROL)) != 0
        offset = self.frames_offset[frame[0]] if one else self.frames_offset[frame]
        out = []
        for axis in range(3):
            nominal = path.end_mm[rows.move, axis]
            slot = np.where(rows.head, self.program.slot[rows.move, axis], -1)
            given = slot >= 0
            out.append(
                AxisRows(
                    command=self.plan.command_mm[part, axis],
                    nominal=nominal,
                    given=given,
                    raw=self.plan.raw[part, axis],
                    reset=control & np.isnan(nominal),
                    word=np.where(given, words.mantissa[slot], 0),
                    decimals=np.where(given, self.style.decimals(slot, axis, unit), 0).astype(np.int8),
                    offset=float(offset[axis]) if one else offset[:, axis],
                    unit=1.0,
                )
            )
        return out

    def _digits(self, rows: Rows, columns: list[AxisRows], a: int, b: int) -> None:
        """Digits of rows a..b, which all count the same way."""
        unit = float(self.frames_unit[self.path.frame[rows.move[a]]])
        counting = bool(rows.flag[a] & np.uint8(Flag.INCREMENTAL))
        for axis, column in enumerate(columns):
            before = float(rows.emitted[a - 1, axis]) if a else float(rows.entry[axis])
            part = column.part(a, b, unit)
            if counting:
                digits = incremental(part, before, self.style.grid(axis, unit))
            else:
                digits = absolute(part, before, self.style.least(axis, unit), self.style.usual(axis, unit))
            rows.put(a, b, axis, digits)

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
            for axis in range(3):
                moved = not abs(rows.emitted[row - 1, axis] - before[axis]) < 1e-9
                given = rows.head[row] and self.program.slot[rows.move[row], axis] >= 0
                nominal_moved = self._nominal_moved(rows, begin, row, axis)
                if not moved or given or np.isnan(rows.emitted[row, axis]):
                    continue
                if nominal_moved or rows.flag[row] & np.uint8(Flag.INCREMENTAL):
                    continue
                self._force(rows, row, axis)

    def _nominal_moved(self, rows: Rows, begin: int, row: int, axis: int) -> bool:
        end = self.path.end_mm
        before = end[rows.move[begin], axis] if begin >= 0 else self.path.start_mm[axis]
        return not abs(end[rows.move[row - 1], axis] - before) < 1e-9

    def _force(self, rows: Rows, row: int, axis: int) -> None:
        frame = int(self.path.frame[rows.move[row]])
        unit, offset = float(self.frames_unit[frame]), float(self.frames_offset[frame, axis])
        decimals = self.style.usual(axis, unit)
        rows.mantissa[row, axis] = round((rows.emitted[row, axis] - offset) / unit * 10**decimals)
        rows.decimals[row, axis] = decimals
        rows.write[row, axis] = True

    # -- edits -------------------------------------------------------------------------------------

    def _word_edits(self, rows: Rows) -> list[Edits]:
        """Replaced and inserted axis words of the blocks that are there, and inserted blocks."""
        program, words = self.program, self.words
        out: list[Edits] = []
        head = np.flatnonzero(rows.head & ((rows.flag & _BYPASS) == 0))
        slot = program.slot[rows.move[head]]
        write = rows.write[head]
        for axis in range(3):
            mine = slot[:, axis]
            replace = np.flatnonzero(write[:, axis] & (mine >= 0))
            index = mine[replace]
            out.append(
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
        at = np.flatnonzero(missing.any(axis=1))
        if at.size:
            out += self._insertions(rows, head[at], slot[at], missing[at])
        tails = np.flatnonzero(~rows.head & ((rows.flag & _BYPASS) == 0))
        if tails.size:
            out += block_edits(self, rows, tails)
        counts = np.bincount(rows.move - rows.move[0])
        self.parts[rows.move[0] : rows.move[-1] + 1] += counts.astype(np.int32)
        return out

    def _insertions(self, rows: Rows, row: Index, slot: npt.NDArray[np.int32], missing: Mask) -> list[Edits]:
        """Words of axes that a block omits, behind its last coordinate word, in that word's style."""
        words = self.words
        ends = np.where(slot >= 0, words.end[slot], -1)
        place = ends.max(axis=1).astype(np.int64)
        last = np.take_along_axis(slot, ends.argmax(axis=1)[:, None], axis=1)[:, 0]
        none = np.flatnonzero(place < 0)
        for i in none.tolist():
            line = int(self.path.line[rows.move[row[i]]])
            last[i] = self.style.last_word(line)
            place[i] = words.end[last[i]]
        style = self.style.separators(last, self.program)
        out = []
        for axis in range(3):
            for which in np.unique(style[missing[:, axis]]).tolist():
                chosen = np.flatnonzero(missing[:, axis] & (style == which))
                prefix = self.prefixes(self.style.separator(which, axis))
                count = len(chosen)
                order = np.full(count, axis + 1, np.int32)
                out.append(
                    Edits(
                        place[chosen], place[chosen], rows.mantissa[row[chosen], axis],
                        rows.decimals[row[chosen], axis], np.full(count, prefix, np.int32), order,
                    )
                )  # fmt: skip
                self.tally.inserted_words += count
        return out

    def _captures(self, rows: Rows) -> list[Edits]:
        """Words that store the present position (G92, G10 L20) move with the correction of that position."""
        out = []
        captures = self.program.captures
        final = rows.first + len(rows.move) == len(self.plan)
        while self.next_capture < len(captures):
            capture = captures[self.next_capture]
            if capture.moves > int(rows.move[-1]) + 1 and not final:
                break
            self.next_capture += 1
            nominal = self.path.end_mm[capture.moves - 1, capture.axis] if capture.moves else None
            row = int(np.searchsorted(rows.move, capture.moves, "left")) - 1
            emitted = rows.emitted[row, capture.axis] if row >= 0 else rows.entry[capture.axis]
            delta = 0.0 if nominal is None else (emitted - nominal) / capture.unit_mm
            grid = self.style.grid(capture.axis, capture.unit_mm)
            written = self.style.decimals_of(capture.word, capture.axis, capture.unit_mm)
            digits = max(grid, written)
            own = int(self.words.mantissa[capture.word]) * 10 ** (digits - written)
            new = own + round(delta * 10**digits)
            if new != own:
                start, end = int(self.words.number[capture.word]), int(self.words.end[capture.word])
                out.append(self.one(start, end, new, digits, b"", 0))
                self.tally.changed_words += 1
        return out

    def one(self, start: int, end: int, mantissa: int, decimals: int, prefix: bytes, order: int) -> Edits:
        """A single edit."""
        return Edits(
            np.array([start], np.int64), np.array([end], np.int64), np.array([mantissa], np.int64),
            np.array([decimals], np.int8), np.array([self.prefixes(prefix)], np.int32),
            np.array([order], np.int32),
        )  # fmt: skip
