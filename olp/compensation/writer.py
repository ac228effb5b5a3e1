"""Writes a plan back into the program's own text: changed and inserted words, inserted blocks, nothing else.

Goes through the rows in chunks, so that memory stays small: digits per axis, then edits, then one splice
per chunk of text.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from olp.compensation.arcwords import arc_edits
from olp.compensation.digits import AxisRows, Digits, absolute, incremental
from olp.compensation.holes import HolePlan, hole_edits
from olp.compensation.plan import Plan
from olp.compensation.style import Style
from olp.errormodel import ErrorModel
from olp.errormodel.base import Array, Mask
from olp.exceptions import ProgramError
from olp.program.edits import BARE, Edits, Prefixes, splice
from olp.program.program import Program
from olp.toolpath import Flag, Kind

Index = npt.NDArray[np.int64]

CHUNK = 1 << 16
_END_M = frozenset({0, 1, 2, 5, 9, 30, 60})
_BYPASS = np.uint8(Flag.CYCLE | Flag.CONTROL)


@dataclass(slots=True)
class Tally:
    """What was changed."""

    changed_words: int = 0
    inserted_words: int = 0
    inserted_blocks: int = 0
    split_moves: int = 0
    rows: list[Index] = field(default_factory=list)


class Writer:
    """One writing of one program. `text()` gives the corrected bytes; `parts` then holds, per move of the
    nominal path, how many moves the corrected text has for it."""

    def __init__(self, program: Program, plan: Plan, model: ErrorModel, tolerance_mm: float, stamp: bytes) -> None:
        assert program.words is not None
        self.program, self.plan, self.model = program, plan, model
        self.words = program.words
        self.tolerance_mm = tolerance_mm
        self.stamp = stamp
        self.style = Style.of(program)
        self.prefixes = Prefixes()
        self.tally = Tally()
        self.path = program.toolpath
        self.emitted = [float(v) for v in self.path.start_mm]
        self.parts = np.zeros(len(self.path), np.int32)
        self.holes = HolePlan.of(program, plan, model, tolerance_mm)
        self.next_capture = 0
        self.frames_offset = np.array([f.offset_mm for f in self.path.frames]).reshape(-1, 3)
        self.frames_unit = np.array([f.unit_mm for f in self.path.frames])
        self.commands: list[Array] = []

    def text(self) -> bytes:
        source = np.frombuffer(self.program.data, np.uint8)
        out: list[bytes] = [self.stamp]
        at = 0
        for first, last in self._spans():
            edits = self._edits(first, last)
            to = len(source) if last == len(self.plan) else self._line_start_of_row(last)
            out.append(
                splice(source[at:to], at, Edits.join(edits), self.prefixes, leading_zero=self.style.leading_zero)
                .tobytes() if edits else source[at:to].tobytes()
            )  # fmt: skip
            at = to
        out.append(source[at:].tobytes())
        return b"".join(self._with_stamp(out))

    def _with_stamp(self, out: list[bytes]) -> list[bytes]:
        """The stamp goes in front, but behind a tape mark at the start."""
        first = out[1] if len(out) > 1 else b""
        return [*_place_stamp(first, self.stamp), *out[2:]] if self.stamp else out[1:]

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
        return list(zip(cuts[:-1], cuts[1:], strict=True))

    # -- one chunk ---------------------------------------------------------------------------------

    def _edits(self, first: int, last: int) -> list[Edits]:
        plan, path = self.plan, self.path
        move = plan.move[first:last]
        flag = path.flag[move]
        rows = _Rows(
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
        breaks = self._breaks(rows)
        for a, b in zip(breaks[:-1], breaks[1:], strict=True):
            if flag[a] & _BYPASS & np.uint8(Flag.CYCLE):
                edits += self._hole(rows, a, b)
            else:
                self._digits(rows, a, b)
        self._after_block_delete(rows)
        edits += self._word_edits(rows)
        edits += arc_edits(self, rows)
        edits += self._captures(rows)
        self.emitted = [float(v) for v in rows.emitted[-1]]
        return [e for e in edits if len(e)]

    def _breaks(self, rows: _Rows) -> list[int]:
        """Where the way of counting changes: G90 and G91, units inside G91, canned cycles."""
        count = len(rows.move)
        key = (rows.flag & np.uint8(Flag.INCREMENTAL | Flag.CYCLE)).astype(np.int64)
        if (key != 0).any():
            frame = self.path.frame[rows.move]
            key = key + np.where(rows.flag & np.uint8(Flag.INCREMENTAL), (self.frames_unit[frame] > 2) * 256, 0)
            cycle = (rows.flag & np.uint8(Flag.CYCLE)) != 0
            key = np.where(cycle, -1 - self.path.line[rows.move].astype(np.int64), key)
        changes = np.flatnonzero(key[1:] != key[:-1]) + 1
        return [0, *changes.tolist(), count]

    def _digits(self, rows: _Rows, a: int, b: int) -> None:
        """Digits of rows a..b, which all count the same way."""
        plan, path, words = self.plan, self.path, self.words
        part = slice(rows.first + a, rows.first + b)
        move = rows.move[a:b]
        frame = path.frame[move]
        one = bool((frame == frame[0]).all())
        unit: Array | float = float(self.frames_unit[frame[0]]) if one else self.frames_unit[frame]
        counting = bool(rows.flag[a] & np.uint8(Flag.INCREMENTAL))
        control = (rows.flag[a:b] & np.uint8(Flag.CONTROL)) != 0
        nominal = path.end_mm[move]
        for axis in range(3):
            slot = np.where(rows.head[a:b], self.program.slot[move, axis], -1)
            given = slot >= 0
            offset: Array | float = (
                float(self.frames_offset[frame[0], axis]) if one else self.frames_offset[frame, axis]
            )
            axis_rows = AxisRows(
                command=plan.command_mm[part, axis],
                nominal=nominal[:, axis],
                given=given,
                raw=plan.raw[part, axis],
                reset=control & np.isnan(nominal[:, axis]),
                word=np.where(given, words.mantissa[slot], 0),
                decimals=np.where(given, self.style.decimals(slot, axis), 0).astype(np.int8),
                offset=offset,
                unit=unit,
            )
            before = float(rows.emitted[a - 1, axis]) if a else float(rows.entry[axis])
            smallest = float(np.min(unit)) if one else float(unit[0])  # type: ignore[index]
            if counting:
                digits = incremental(axis_rows, before, self.style.grid(axis, smallest))
            elif one:
                digits = absolute(
                    axis_rows, before, self.style.least(axis, smallest), self.style.usual(axis, smallest)
                )
            else:
                digits = self._mixed(axis_rows, before, axis, frame)
            rows.put(a, b, axis, digits)

    def _mixed(self, axis_rows: AxisRows, before: float, axis: int, frame: npt.NDArray[np.int32]) -> Digits:
        """G90 rows over several frames: one stretch of equal units at a time."""
        unit = self.frames_unit[frame]
        cuts = [0, *(np.flatnonzero(unit[1:] != unit[:-1]) + 1).tolist(), len(unit)]
        parts = []
        for a, b in zip(cuts[:-1], cuts[1:], strict=True):
            s = slice(a, b)
            mine = AxisRows(
                *(getattr(axis_rows, n)[s] for n in ("command", "nominal", "given", "raw", "reset", "word", "decimals")),
                axis_rows.offset[s] if np.ndim(axis_rows.offset) else axis_rows.offset,  # type: ignore[index]
                float(unit[a]),
            )  # fmt: skip
            u = float(unit[a])
            digits = absolute(mine, before, self.style.least(axis, u), self.style.usual(axis, u))
            before = float(digits.emitted[-1])
            parts.append(digits)
        return Digits(*(np.concatenate([getattr(p, n) for p in parts]) for n in Digits.__slots__))

    def _after_block_delete(self, rows: _Rows) -> None:
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

    def _nominal_moved(self, rows: _Rows, begin: int, row: int, axis: int) -> bool:
        end = self.path.end_mm
        before = end[rows.move[begin], axis] if begin >= 0 else self.path.start_mm[axis]
        return not abs(end[rows.move[row - 1], axis] - before) < 1e-9

    def _force(self, rows: _Rows, row: int, axis: int) -> None:
        frame = int(self.path.frame[rows.move[row]])
        unit, offset = float(self.frames_unit[frame]), float(self.frames_offset[frame, axis])
        decimals = self.style.usual(axis, unit)
        rows.mantissa[row, axis] = round((rows.emitted[row, axis] - offset) / unit * 10**decimals)
        rows.decimals[row, axis] = decimals
        rows.write[row, axis] = True

    # -- edits -------------------------------------------------------------------------------------

    def _word_edits(self, rows: _Rows) -> list[Edits]:
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
        counts = np.bincount(
            rows.move[(rows.flag & _BYPASS) == 0] - rows.move[0], minlength=int(rows.move[-1] - rows.move[0]) + 1
        )
        self.parts[rows.move[0] : rows.move[-1] + 1] += counts.astype(np.int32)
        return out

    def _insertions(self, rows: _Rows, row: Index, slot: npt.NDArray[np.int32], missing: Mask) -> list[Edits]:
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

    def _blocks(self, rows: _Rows, tails: Index) -> list[Edits]:
        """New blocks for the later parts of subdivided moves; plain words, modal codes hold."""
        program = self.program
        line_no = self.path.line[rows.move[tails]]
        place = program.line_end[line_no - 1].astype(np.int64)
        arc = np.isin(self.path.kind[rows.move[tails]], (Kind.ARC_CW, Kind.ARC_CCW))
        eols = {line: self._block_start(line, rows) for line in np.unique(line_no).tolist()}
        out: list[Edits] = []
        first_axis = np.where(rows.write[tails].any(axis=1), rows.write[tails].argmax(axis=1), -1)
        serial = np.arange(len(tails), dtype=np.int64)
        lead = np.array([eols[line] for line in line_no.tolist()], np.int64)
        for axis in range(3):
            chosen = np.flatnonzero(rows.write[tails, axis] & ~arc)
            begins = first_axis[chosen] == axis
            word = self.prefixes(b" " + b"XYZ"[axis : axis + 1])
            starts = {
                int(p): self.prefixes(self.prefixes.table[int(p)] + b"XYZ"[axis : axis + 1])
                for p in np.unique(lead[chosen[begins]])
            }
            prefix = np.full(len(chosen), word, np.int32)
            prefix[begins] = [starts[int(p)] for p in lead[chosen[begins]]]
            out.append(
                Edits(
                    place[chosen], place[chosen], rows.mantissa[tails[chosen], axis],
                    rows.decimals[tails[chosen], axis], prefix, (serial[chosen] * 8 + 16 + axis).astype(np.int32),
                )
            )  # fmt: skip
        empty = (first_axis < 0) & ~arc
        if empty.any():
            # a part whose rounded end is where it began needs no block
            np.subtract.at(self.parts, rows.move[tails[empty]], 1)
        self.tally.inserted_blocks += int((~empty).sum())
        out += self._inverse_time(rows, tails, serial)
        out += self._end_words(rows, tails, place)
        self.tally.split_moves += len(np.unique(rows.move[tails]))
        return out

    def _block_start(self, line: int, rows: _Rows) -> int:
        start = self.program.eol(line)
        text = self.program.text(line).lstrip()
        return self.prefixes(start + (b"/" if text.startswith("/") else b""))

    def _inverse_time(self, rows: _Rows, tails: Index, serial: Index) -> list[Edits]:
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
                    start, end, prefix, order = int(self.words.number[index]), int(self.words.end[index]), b"", 0
                else:
                    start = end = place
                    prefix, order = b" F", int(serial[np.searchsorted(tails, row)]) * 8 + 16 + 5
                out.append(self.one(start, end, int(feeds[i]), decimals, prefix, order))
        return out

    def _end_words(self, rows: _Rows, tails: Index, place: Index) -> list[Edits]:
        """M words that end a block (M0 M5 M9 M30 …) go from the first part to the last."""
        out = []
        for move in np.unique(rows.move[tails]).tolist():
            line = int(self.path.line[move])
            moved = [
                i for i in self.words.of_line(line)
                if self.words.letter[i] == 77 and not self.words.decimals[i] and int(self.words.mantissa[i]) in _END_M
            ]  # fmt: skip
            if not moved:
                continue
            at = int(self.program.line_end[line - 1])
            for k, i in enumerate(moved):
                start, end = int(self.words.start[i]), int(self.words.end[i])
                out.append(self.one(start, end, BARE, 0, b"", 0))
                out.append(self.one(at, at, BARE, 0, b" " + self.program.data[start:end], 2**30 + k))
        return out

    def _captures(self, rows: _Rows) -> list[Edits]:
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
            digits = max(grid, int(self.style.decimals(np.array([capture.word]), capture.axis)[0]))
            own = int(self.words.mantissa[capture.word]) * 10 ** (
                digits - int(self.style.decimals(np.array([capture.word]), capture.axis)[0])
            )
            new = own + round(delta * 10**digits)
            if new != own:
                out.append(
                    self.one(
                        int(self.words.number[capture.word]), int(self.words.end[capture.word]), new, digits, b"", 0
                    )
                )
                self.tally.changed_words += 1
        return out

    def _hole(self, rows: _Rows, a: int, b: int) -> list[Edits]:
        return hole_edits(self, rows, a, b)

    def one(self, start: int, end: int, mantissa: int, decimals: int, prefix: bytes, order: int) -> Edits:
        """A single edit."""
        return Edits(
            np.array([start], np.int64), np.array([end], np.int64), np.array([mantissa], np.int64),
            np.array([decimals], np.int8), np.array([self.prefixes(prefix)], np.int32), np.array([order], np.int32),
        )  # fmt: skip


@dataclass(slots=True, eq=False)
class _Rows:
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

    def put(self, a: int, b: int, axis: int, digits: Digits) -> None:
        self.emitted[a:b, axis] = digits.emitted
        self.write[a:b, axis] = digits.write
        self.mantissa[a:b, axis] = digits.mantissa
        self.decimals[a:b, axis] = digits.decimals


def _place_stamp(first: bytes, stamp: bytes) -> list[bytes]:
    return [stamp, first]
