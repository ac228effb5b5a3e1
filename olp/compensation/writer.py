"""Writes a plan back into the program's own text: changed and inserted words, inserted blocks, nothing else.

Goes through the rows in chunks, so that memory stays small: digits per axis, then edits, then one splice
per chunk of text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from olp.compensation.arcwords import arc_edits
from olp.compensation.digits import AxisRows, Digits, absolute, incremental
from olp.compensation.holes import HolePlan, hole_edits
from olp.compensation.plan import Plan, targets
from olp.compensation.style import Style
from olp.errormodel import ErrorModel
from olp.errormodel.base import Array, Mask
from olp.exceptions import ProgramError
from olp.machine import Vector
from olp.program.edits import BARE, Edits, Prefixes, splice
from olp.program.program import Program
from olp.toolpath import Flag, Frame, Kind

Index = npt.NDArray[np.int64]

CHUNK = 1 << 15
_END_M = frozenset({0, 1, 2, 5, 9, 30, 60})
_BYPASS = np.uint8(Flag.CYCLE | Flag.CONTROL)


@dataclass(slots=True)
class Tally:
    """What was changed."""

    changed_words: int = 0
    inserted_words: int = 0
    inserted_blocks: int = 0


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
            out[0] = stamped(out[0], self.stamp, self.program.eol(1))
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
            if flag[a] & _BYPASS & np.uint8(Flag.CYCLE):
                edits += self._hole(rows, a, b)
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
            out += self._blocks(rows, tails)
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

    def _blocks(self, rows: Rows, tails: Index) -> list[Edits]:
        """New blocks for the later parts of subdivided moves; plain words, modal codes hold."""
        line_no = self.path.line[rows.move[tails]]
        arc = np.isin(self.path.kind[rows.move[tails]], (Kind.ARC_CW, Kind.ARC_CCW))
        straight = ~arc | self.plan.take_up[rows.first + tails]
        before = rows.before[tails]
        place = np.where(
            before, self.program.line_start[line_no - 1], self.program.line_end[line_no - 1]
        ).astype(np.int64)
        lead = self._leads(line_no, arc & straight, before)
        write = rows.write[tails]
        first_axis = np.where(write.any(axis=1), write.argmax(axis=1), -1)
        out: list[Edits] = []
        for axis in range(3):
            chosen = np.flatnonzero(write[:, axis] & straight)
            letter = b"XYZ"[axis : axis + 1]
            begins = first_axis[chosen] == axis
            prefix = np.full(len(chosen), self.prefixes(b" " + letter), np.int32)
            starts = {
                int(p): self.prefixes(self.prefixes.table[int(p)] + letter)
                for p in np.unique(lead[chosen[begins]])
            }
            prefix[begins] = [starts[int(p)] for p in lead[chosen[begins]]]
            row = tails[chosen]
            out.append(
                Edits(
                    place[chosen], place[chosen], rows.mantissa[row, axis], rows.decimals[row, axis], prefix,
                    (row * 8 + 16 + axis).astype(np.int32),
                )
            )  # fmt: skip
        empty = (first_axis < 0) & straight
        # a part whose rounded end is where it began needs no block
        np.subtract.at(self.parts, rows.move[tails[empty]], 1)
        for i in np.flatnonzero(before & ~empty).tolist():
            at, tail, line = int(place[i]), int(tails[i]), int(line_no[i])
            self._check_take_up(rows, tail)
            suffix = self._feed_of(line) + self.program.eol(line)
            out.append(self.one(at, at, BARE, 0, suffix, rows.serial(tail) + 5))
            if rows.head[tail + 1]:
                out += self._arc_word(rows, tail + 1)
        self.tally.inserted_blocks += int((~empty).sum())
        out += self._inverse_time(rows, tails)
        out += self._end_words(rows, tails[~before])
        return out

    def _leads(self, line_no: npt.NDArray[np.int32], turning: Mask, before: Mask) -> Index:
        """Prefix of the first word of each inserted block: line end, `/` and, to take up lost motion at an
        arc, G1."""
        lines, which = np.unique(line_no, return_inverse=True)
        table = np.zeros((len(lines), 3), np.int64)
        for i, line in enumerate(lines.tolist()):
            start = self.block_start(line)
            deleted = start[len(self.program.eol(line)) :]
            table[i] = (self.prefixes(start), self.prefixes(start + b"G1 "), self.prefixes(deleted + b"G1 "))
        return np.asarray(table[which, np.where(before, 2, np.where(turning, 1, 0))], np.int64)

    def _check_take_up(self, rows: Rows, row: int) -> None:
        if rows.flag[row] & np.uint8(Flag.INVERSE_TIME):
            raise ProgramError(
                "an arc in G93 needs a step that takes up lost motion before it, which has no time of its "
                "own; program the arc in G94",
                line=int(self.path.line[rows.move[row]]),
            )

    def _feed_of(self, line: int) -> bytes:
        """The F word of a block, for the block that is put before it."""
        index = self.style.word(line, "F")
        if index is None:
            return b""
        return b" " + self.program.data[int(self.words.start[index]) : int(self.words.end[index])]

    def _arc_word(self, rows: Rows, row: int) -> list[Edits]:
        """G2 or G3 for an arc block that relied on the modal code which the block before it changed."""
        move = int(rows.move[row])
        line = int(self.path.line[move])
        code = 2 if self.path.kind[move] == Kind.ARC_CW else 3
        index = self.words.of_line(line)
        if any(
            self.words.letter[i] == 71 and self.words.mantissa[i] == code and not self.words.decimals[i]
            for i in index
        ):
            return []
        slot = self.program.slot[move]
        first = [int(self.words.start[s]) for s in slot if s >= 0]
        at = min(first or [int(self.words.start[i]) for i in index if self.words.letter[i] != ord("N")])
        return [self.one(at, at, BARE, 0, b"G%d " % code, rows.serial(row - 1) + 6)]

    def _inverse_time(self, rows: Rows, tails: Index) -> list[Edits]:
        """In G93 every part of a block gets its share of the time: F grows by what its path shrinks."""
        timed = np.flatnonzero((rows.flag[tails] & np.uint8(Flag.INVERSE_TIME)) != 0)
        out = []
        for move in np.unique(rows.move[tails[timed]]).tolist():
            part = np.flatnonzero(rows.move == move)
            line = int(self.path.line[move])
            index = self.style.word(line, "F")
            if index is None:
                raise ProgramError("a block in G93 needs its own F word", line=line)
            value = float(self.words.mantissa[index]) / 10.0 ** int(self.words.decimals[index])
            reach = self.plan.reach[rows.first + part]
            share = np.maximum(np.diff(reach, prepend=0.0), 1e-6)
            decimals = max(int(self.words.decimals[index]), 4)
            feeds = np.rint(value / share * 10**decimals).astype(np.int64)
            place = int(self.program.line_end[line - 1])
            kept = [i for i, r in enumerate(part.tolist()) if rows.head[r] or rows.write[r].any()]
            for i in kept:
                row = int(part[i])
                if rows.head[row]:
                    start, end = int(self.words.number[index]), int(self.words.end[index])
                    prefix, order = b"", 0
                else:
                    start = end = place
                    prefix, order = b" F", rows.serial(row) + 5
                out.append(self.one(start, end, int(feeds[i]), decimals, prefix, order))
        return out

    def _end_words(self, rows: Rows, tails: Index) -> list[Edits]:
        """M words that end a block (M0 M5 M9 M30 …) go from the first part to the last."""
        out = []
        for move in np.unique(rows.move[tails]).tolist():
            line = int(self.path.line[move])
            moved = [
                i for i in self.words.of_line(line)
                if self.words.letter[i] == 77 and not self.words.decimals[i]
                and int(self.words.mantissa[i]) in _END_M
            ]  # fmt: skip
            if not moved:
                continue
            at = int(self.program.line_end[line - 1])
            for k, i in enumerate(moved):
                start, end = int(self.words.start[i]), int(self.words.end[i])
                out.append(self.one(start, end, BARE, 0, b"", 0))
                out.append(self.one(at, at, BARE, 0, b" " + self.program.data[start:end], 2**30 + k))
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

    def _hole(self, rows: Rows, a: int, b: int) -> list[Edits]:
        return hole_edits(self, rows, a, b)

    def one(self, start: int, end: int, mantissa: int, decimals: int, prefix: bytes, order: int) -> Edits:
        """A single edit."""
        return Edits(
            np.array([start], np.int64), np.array([end], np.int64), np.array([mantissa], np.int64),
            np.array([decimals], np.int8), np.array([self.prefixes(prefix)], np.int32),
            np.array([order], np.int32),
        )  # fmt: skip


@dataclass(slots=True, eq=False)
class Rows:
    """Rows of the plan on their way into text. `head` marks the row that keeps its block's own line."""

    first: int
    move: npt.NDArray[np.int32]
    head: Mask
    flag: npt.NDArray[np.uint8]
    emitted: Array
    entry: Array
    write: Mask
    mantissa: Index
    decimals: npt.NDArray[np.int8]
    before: Mask = field(default_factory=lambda: np.zeros(0, bool))

    def serial(self, row: int) -> int:
        """Order of a row's words among insertions at one place."""
        return row * 8 + 16

    def number(self, writer: Writer, row: int, axis: int) -> tuple[int, int]:
        """Mantissa and decimals that say where the axis is after the row, whether or not it changes."""
        if self.write[row, axis] or self.flag[row] & np.uint8(Flag.INCREMENTAL):
            return int(self.mantissa[row, axis]), int(self.decimals[row, axis])
        frame = writer.frame_of(int(self.move[row]))
        decimals = writer.style.usual(axis, frame.unit_mm)
        value = (self.emitted[row, axis] - frame.offset_mm[axis]) / frame.unit_mm
        return round(value * 10**decimals), decimals

    def put(self, a: int, b: int, axis: int, digits: Digits) -> None:
        self.emitted[a:b, axis] = digits.emitted
        self.write[a:b, axis] = digits.write
        self.mantissa[a:b, axis] = digits.mantissa
        self.decimals[a:b, axis] = digits.decimals


def stamped(text: bytes, stamp: bytes, eol: bytes) -> bytes:
    """The text with the stamp as a line of its own in front, behind a tape mark and a program number."""
    at = 3 if text[:3] == b"\xef\xbb\xbf" else 0
    if text[at : at + 1] == b"%":
        at = _line_after(text, at)
    if text[at : at + 1] and text[at : at + 1] in b"Oo:":
        at = _line_after(text, at)
    return text[:at] + stamp + eol + text[at:]


def _line_after(text: bytes, at: int) -> int:
    end = text.find(b"\n", at)
    return len(text) if end < 0 else end + 1
