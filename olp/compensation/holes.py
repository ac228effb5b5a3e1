"""Canned cycles, corrected in columns: X, Y, Z and R words of each block."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from olp.compensation.digits import AxisRows, Digits, absolute
from olp.compensation.incremental_holes import SeriesWords, incremental_block
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array, Index, any_in_row, distinct, most_in_row
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag
from olp.program.holes import CHANGED, Holes, Small
from olp.program.text.edits import EditList, Edits

#: mm; a hole that ends this near its R level returns to it
_SAME_MM = 1e-9


class HoleWords:
    """Words of the holes of one program, in the order of its rows. A block of a series inherits R and Z of
    the block before, as they are written."""

    def __init__(self, holes: Holes) -> None:
        self._holes = holes
        self._series = SeriesWords()

    def edits(self, writer: Writer, rows: Rows, a: int, b: int) -> list[Edits]:
        """Edits of the cycle blocks whose moves are rows a..b, and the positions after them."""
        holes, one_by_one = self._holes, EditList(writer.prefixes)
        edits: list[Edits] = []
        first, last = int(rows.move[a]), int(rows.move[b - 1])
        begin, end = np.searchsorted(holes.first, (first, last + 1))
        for i, j in pairwise(self._pieces(writer, int(begin), int(end))):
            row = a + int(holes.first[i]) - first
            self._enter(writer, rows, i, row)
            profile = writer.program.rs274
            self._series.go_on(
                bool(holes.incremental[i]), "XYZ"[PLANES[holes.plane[i]][2]],
                levels_stay=profile.cycles.levels_stay,
            )  # fmt: skip
            if rows.flag[row] & np.uint8(Flag.PASS):
                self._leave(writer, rows, i, j, row)
            elif holes.incremental[i]:
                for k in (i + np.flatnonzero(holes.repeat[i:j] == 0)).tolist():
                    incremental_block(
                        writer, rows, self._series, k, a + int(holes.first[k]) - first, one_by_one
                    )
            else:
                edits += self._absolute(writer, rows, i, j, row)
        return [*edits, one_by_one.done()]

    def _pieces(self, writer: Writer, begin: int, end: int) -> list[int]:
        """Where holes begin to be read otherwise: another series, plane or frame, G90 or G91, or left as they
        are."""
        holes, path, mine = self._holes, writer.path, slice(begin, end)
        first = holes.first[mine]
        keys = (
            holes.series[mine], holes.plane[mine], path.frame[first], holes.incremental[mine],
            path.flag[first] & np.uint8(Flag.PASS),
        )  # fmt: skip
        changes = np.any([key[1:] != key[:-1] for key in keys], axis=0)
        return [begin, *(begin + 1 + np.flatnonzero(changes)).tolist(), end]

    def _enter(self, writer: Writer, rows: Rows, i: int, row: int) -> None:
        """Begin the series of hole `i`, whose first row is `row`, where it is a new one."""
        number = int(self._holes.series[i])
        if self._series.number != number:
            frame, third = writer.frame_of(int(self._holes.first[i])), PLANES[self._holes.plane[i]][2]
            before = rows.emitted[row - 1] if row else rows.entry
            initial = float(before[third] - frame.offset_mm[third]) / frame.unit_mm
            self._series = SeriesWords(number, initial)

    def _leave(self, writer: Writer, rows: Rows, i: int, j: int, row: int) -> None:
        """Holes i..j stay as they are: take over where they end, and their R and depth."""
        holes = self._holes
        count = holes.last[i:j] - holes.first[i:j]
        rows.emitted[row : row + int(count.sum())] = np.repeat(
            writer.path.end_mm[holes.last[i:j] - 1], count, axis=0
        )
        third = PLANES[holes.plane[i]][2]
        unit = writer.frame_of(int(holes.first[i])).unit_mm
        for letter in ("R", "XYZ"[third]):
            slot = holes.word[i:j, CHANGED.index(letter)]
            if (slot >= 0).any():
                word = int(slot[slot >= 0][-1])
                decimals = writer.style.decimals_of(word, third, unit)
                self._series.inherited[letter] = int(writer.words.mantissa[word]) / 10**decimals

    def _absolute(self, writer: Writer, rows: Rows, i: int, j: int, row: int) -> list[Edits]:
        """Edits of holes i..j, which are in G90 and alike; repeats make the same hole again."""
        holes, plan = self._holes, writer.holes
        some = i + np.flatnonzero(holes.repeat[i:j] == 0)
        first, second, third = PLANES[holes.plane[i]]
        frame = writer.frame_of(int(holes.first[i]))
        offset, unit = frame.offset_mm[third], frame.unit_mm
        turn = writer.turn_of(rows)[row]
        before = writer.along_words((rows.emitted[row - 1] if row else rows.entry)[None], turn)[0]
        middle = (plan.level_mm[some] + plan.bottom_mm[some]) / 2
        columns = {
            "XYZ"[axis]: _digits(writer, some, "XYZ"[axis], axis, middle[:, axis], float(before[axis]))
            for axis in (first, second)
        }
        depths = (("R", plan.level_mm), ("XYZ"[third], plan.bottom_mm))
        if self._series.turned and any(
            _digits(
                writer,
                some,
                letter,
                third,
                depth[some, third],
                offset + self._series.inherited[letter] * unit,
            ).write.any()
            for letter, depth in depths
        ):
            self._series.restate()
        for letter, depth in depths:
            held = offset + self._series.inherited.get(letter, np.nan) * unit
            digits = columns[letter] = _digits(writer, some, letter, third, depth[some, third], held)
            put = np.flatnonzero((holes.word[some, CHANGED.index(letter)] >= 0) | digits.write)
            if put.size:
                decimals = int(digits.decimals[put[-1]])
                self._series.inherited[letter] = int(digits.mantissa[put[-1]]) / 10**decimals
        initial = self._series.initial * unit + offset
        level = columns["R"].emitted
        to_r = np.abs(writer.path.end_mm[holes.last[some] - 1, third] - holes.r_mm[some]) < _SAME_MM
        emitted = np.empty((len(some), 3))
        for axis in (first, second):
            emitted[:, axis] = columns["XYZ"[axis]].emitted
        emitted[:, third] = np.where(to_r | (level > initial), level, initial)
        emitted = writer.along_axes(emitted, turn)
        # rows of all strokes of all repeats of a block
        count = np.add.reduceat(holes.last[i:j] - holes.first[i:j], some - i)
        rows.emitted[row : row + int(count.sum())] = np.repeat(emitted, count, axis=0)
        return list(_edits(writer, holes.word[some], holes.last_word[some], columns))


def _digits(writer: Writer, some: Index, letter: str, axis: int, command: Array, before: float) -> Digits:
    """Digits of the words of an axis of holes in G90, R among them; `before` is the position that the first
    of them takes over, NaN where it takes over none."""
    holes, style = writer.holes.holes, writer.style
    frame = writer.frame_of(int(holes.first[some[0]]))
    slot, none = holes.word[some, CHANGED.index(letter)], np.zeros(len(some), bool)
    given = slot >= 0
    return absolute(
        AxisRows(
            command=command,
            nominal=command,
            given=given,
            raw=none,
            reset=none,
            word=np.where(given, writer.words.mantissa[slot], 0),
            decimals=np.where(given, style.decimals(slot, axis, frame.unit_mm), 0).astype(np.int8),
            offset=float(writer.word_offset_mm[writer.path.frame[holes.first[some[0]]], axis]),
            unit=frame.unit_mm,
        ),
        before,
        style.least(axis, frame.unit_mm),
        style.usual(axis, frame.unit_mm),
    )


def _edits(writer: Writer, word: Small, last_word: Small, columns: dict[str, Digits]) -> Iterator[Edits]:
    """Edits of blocks whose X, Y, Z and R are `word` (h, 4): words replaced, or inserted behind the last of
    these, in its style and in the order of `columns`."""
    words = writer.words
    anchor = np.where(any_in_row(word >= 0), most_in_row(word), last_word)
    style = writer.style.separators(anchor, writer.program)
    for order, (letter, digits) in enumerate(columns.items()):
        slot = word[:, CHANGED.index(letter)]
        own = np.flatnonzero(digits.write & (slot >= 0))
        new = np.flatnonzero(digits.write & (slot < 0))
        writer.tally.changed_words += len(own)
        writer.tally.inserted_words += len(new)
        number, end = words.number[slot[own]], words.end[slot[own]]
        yield Edits.of(number, end, digits.mantissa[own], digits.decimals[own])
        if not new.size:
            continue
        prefix = np.zeros(len(new), np.int32)
        for which in distinct(style[new]).tolist():
            text = writer.style.separator(which, letter.encode())
            prefix[style[new] == which] = writer.prefixes(text)
        place = words.end[anchor[new]]
        yield Edits.of(place, place, digits.mantissa[new], digits.decimals[new], prefix, order + 1)
