"""Canned cycles, corrected in columns: X, Y, Z and R words of each block."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from olp.compensation.digits import Absolute, AxisRows, Digits, Starts
from olp.compensation.drilled_rows import DrilledRows, Heights
from olp.compensation.incremental_holes import SeriesWords, incremental_block, restates
from olp.compensation.rows import Rows
from olp.compensation.stretches import Decimals, Stretches, digits_of
from olp.compensation.writer import Writer
from olp.core.arrays import Array, Index, any_in_row, distinct, most_in_row
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Toolpath
from olp.core.values import dataclass
from olp.program.holes import CHANGED, Holes, Small
from olp.program.text.edits import EditList, Edits

#: mm; a hole that ends this near its R level returns to it
_SAME_MM = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Rows `a`..`b` of a chunk that are written at once, and which runs `first`..`last` of holes are among
    them (`HoleWords.parts`). `alone` is a run of holes that are left as they are, or in G91."""

    a: int
    b: int
    first: int
    last: int
    alone: bool


class HoleWords:
    """Words of the holes of one program, in the order of its rows. A block of a series inherits R and Z of
    the block before, as they are written."""

    def __init__(self, holes: Holes) -> None:
        self._holes = holes
        self._series = SeriesWords()
        #: where runs of holes begin that are alike and one behind the other, and where the last one ends
        self._bounds = np.zeros(1, np.int64)

    def parts(self, writer: Writer, rows: Rows, cuts: Index) -> list[Part]:
        """The parts of a chunk, which is cut at rows `cuts` too. Series in G90 and the rows between them are
        one part, as far as they are in one plane."""
        holes, path = self._holes, writer.path
        self._bounds = bounds = self._runs(path, int(rows.move[0]), int(rows.move[-1]) + 1)
        begin = bounds[:-1]
        row, stop = (rows.move.searchsorted(m) for m in (holes.first[begin], holes.last[bounds[1:] - 1]))
        series, plane = holes.series[begin], holes.plane[begin]
        alone = holes.incremental[begin] | ((path.flag[holes.first[begin]] & np.uint8(Flag.PASS)) != 0)
        apart = alone.copy()
        apart[1:] |= (series[1:] == series[:-1]) | (plane[1:] != plane[:-1])
        every = distinct(np.concatenate((cuts, [0, len(rows.move)], row[apart], stop[alone])))
        of = row.searchsorted(every)
        return [
            Part(a, b, i, j, bool(i < j and alone[i]))
            for (a, b), (i, j) in zip(pairwise(every.tolist()), pairwise(of.tolist()), strict=True)
        ]

    def _runs(self, path: Toolpath, first: int, last: int) -> Index:
        """Where the holes of moves `first`..`last` begin to be read otherwise: behind other moves, in another
        series, plane or frame, in G90 or G91, or left as they are."""
        holes = self._holes
        begin, end = np.searchsorted(holes.first, (first, last)).tolist()
        if begin == end:
            return np.array([begin])
        mine = slice(begin, end)
        move = holes.first[mine]
        keys = (
            holes.series[mine], holes.plane[mine], path.frame[move], holes.incremental[mine],
            path.flag[move] & np.uint8(Flag.PASS),
        )  # fmt: skip
        changes = np.any([key[1:] != key[:-1] for key in keys], axis=0)
        changes |= move[1:] != holes.last[mine][:-1]
        return np.array([begin, *(begin + 1 + np.flatnonzero(changes)).tolist(), end])

    def edits(self, writer: Writer, rows: Rows, part: Part, columns: list[AxisRows]) -> list[Edits]:
        """Edits of the cycle blocks of a part, and the positions behind all of its rows. `columns` are those
        of the rows of the chunk."""
        if not part.alone:
            return self._together(writer, rows, part, columns)
        holes, one_by_one = self._holes, EditList(writer.prefixes)
        i, j = self._bounds[part.first], self._bounds[part.last]
        self._enter(writer, rows, int(i), part.a)
        self._go_on(writer, int(i))
        if rows.flag[part.a] & np.uint8(Flag.PASS):
            self._leave(writer, rows, int(i), int(j), part.a)
            return []
        if self._series.turned and restates(writer, self._series, int(i), int(j)):
            self._series.restate()
        for k in (i + np.flatnonzero(holes.repeat[i:j] == 0)).tolist():
            row = part.a + int(holes.first[k] - holes.first[i])
            incremental_block(writer, rows, self._series, k, row, one_by_one)
        return [one_by_one.done()]

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

    def _go_on(self, writer: Writer, i: int) -> None:
        """Take the numbers of the series for those of the mode of hole `i`."""
        holes = self._holes
        self._series.go_on(
            bool(holes.incremental[i]), "XYZ"[PLANES[holes.plane[i]][2]],
            levels_stay=writer.program.rs274.cycles.levels_stay,
        )  # fmt: skip

    def _together(self, writer: Writer, rows: Rows, part: Part, columns: list[AxisRows]) -> list[Edits]:
        """Edits of runs of holes in G90, and the digits of the rows between them; repeats make the same hole
        again."""
        holes, plan, style = self._holes, writer.holes, writer.style
        a, b = part.a, part.b
        drilled = DrilledRows.of(holes, self._bounds[part.first : part.last + 1], rows, a, b)
        some, plain = drilled.block, drilled.plain
        first, second, third = PLANES[holes.plane[some[0]]]
        turn = int(writer.turn_of(rows)[a])
        entry = writer.along_words((rows.emitted[a - 1] if a else rows.entry)[None], turn)[0].tolist()
        middle = (plan.level_mm[some] + plan.bottom_mm[some]) / 2
        emitted, words = np.empty((len(some), 3)), {}
        for axis in (first, second):
            column = columns[axis].part(drilled.items)
            _put_blocks(writer, column, drilled, axis, middle[:, axis])
            stretches = Stretches.of(drilled.counting, column.unit, drilled.stretch)
            digits = digits_of(column, stretches, entry[axis], Decimals.of(style, axis, column.unit))
            rows.put(drilled.items[plain], axis, digits.part(plain))
            words["XYZ"[axis]] = digits.part(drilled.place)
            emitted[:, axis] = digits.emitted[drilled.place]
        before = self._series
        if before.number != holes.series[some[0]]:
            # a series begins with both, so it takes over none of these from the one before
            before = SeriesWords(before.number, before.initial)
        else:
            self._go_on(writer, int(some[0]))
        column = columns[third].part(drilled.items[drilled.place])
        levels, kept = _both_levels(writer, column, drilled, third, before)
        stated = bool((holes.word[some[0], [CHANGED.index(letter) for letter in levels]] >= 0).all())
        if before.turned and (stated or any(one.write[drilled.run == 0].any() for one in levels.values())):
            before.restate()
            levels, kept = _both_levels(writer, column, drilled, third, before)
        words |= levels
        to_r = np.abs(writer.path.end_mm[holes.last[some] - 1, third] - holes.r_mm[some]) < _SAME_MM
        frames = [writer.frame_of(move) for move in holes.first[drilled.runs].tolist()]
        heights = Heights(
            drilled, holes, frames, words["R"].emitted, to_r, before.number, before.initial
        )  # fmt: skip
        height = entry[third]
        if plain.size:
            column = columns[third].part(drilled.items[plain])
            stretches = Stretches.of(drilled.counting[plain], column.unit, drilled.stretch[plain])
            number = drilled.stretch[plain[stretches.bounds[:-1]]].tolist()
            digits = digits_of(
                column, stretches, height, Decimals.of(style, third, column.unit),
                lambda k, left: heights.after(number[k], left),
            )  # fmt: skip
            rows.put(drilled.items[plain], third, digits)
            height = float(digits.emitted[-1])
        emitted[:, third] = heights.emitted(height)
        rows.emitted[drilled.strokes] = np.repeat(emitted, drilled.count, axis=0)
        if turn:
            rows.emitted[a:b] = writer.along_axes(rows.emitted[a:b], turn)
        turned = before.turned and len(drilled.runs) == 1
        self._series = SeriesWords(heights.number, heights.initial, kept, incremental=False, turned=turned)
        return list(_edits(writer, holes.word[some], holes.last_word[some], words))


def _put_blocks(writer: Writer, column: AxisRows, drilled: DrilledRows, axis: int, command: Array) -> None:
    """Put the words of blocks of cycles into the column of an axis, which is that of `drilled.items`."""
    holes, place = writer.holes.holes, drilled.place
    slot = holes.word[drilled.block, axis]
    given = slot >= 0
    unit = writer.frame_unit_mm[writer.path.frame[holes.first[drilled.block]]]
    column.command[place] = column.nominal[place] = command
    column.given[place], column.raw[place], column.reset[place] = given, False, False
    column.word[place] = np.where(given, writer.words.mantissa[slot], 0)
    column.decimals[place] = np.where(given, writer.style.decimals(slot, axis, unit), 0)


def _both_levels(
    writer: Writer, column: AxisRows, drilled: DrilledRows, axis: int, before: SeriesWords
) -> tuple[dict[str, Digits], dict[str, float]]:
    """The digits of R and depth of blocks by their letters, and what the last run leaves (`_levels`)."""
    plan, kept = writer.holes, dict(before.inherited)
    levels = (("R", plan.level_mm), ("XYZ"[axis], plan.bottom_mm))
    some = drilled.block
    words = {
        letter: _levels(writer, column, drilled, letter, axis, level[some, axis], before, kept)
        for letter, level in levels
    }
    return words, kept


def _levels(
    writer: Writer, column: AxisRows, drilled: DrilledRows, letter: str, axis: int, command: Array,
    before: SeriesWords, kept: dict[str, float],
) -> Digits:  # fmt: skip
    """Digits of the R or depth words of blocks, from the column of the tool axis at these blocks. The first
    run inherits what its series holds `before`, the others nothing; what the last one leaves is `kept`."""
    holes = writer.holes.holes
    slot = holes.word[drilled.block, CHANGED.index(letter)]
    given, none = slot >= 0, np.zeros(len(slot), bool)
    unit = writer.frame_unit_mm[writer.path.frame[holes.first[drilled.block]]]
    rows = AxisRows(
        command=command,
        nominal=command,
        given=given,
        raw=none,
        reset=none,
        word=np.where(given, writer.words.mantissa[slot], 0),
        decimals=np.where(given, writer.style.decimals(slot, axis, unit), 0).astype(np.int8),
        offset=column.offset,
        unit=column.unit,
    )
    starts = Starts.of(np.append(0, drilled.lasts()[:-1] + 1), len(slot))
    frame, held = writer.frame_of(int(holes.first[drilled.block[0]])), np.full(len(drilled.runs), np.nan)
    held[0] = frame.offset_mm[axis] + before.inherited.get(letter, np.nan) * frame.unit_mm
    places = Decimals.of(writer.style, axis, rows.unit)
    digits = Absolute.of(rows, starts, places.least, places.usual).digits(rows, held)
    put = np.flatnonzero((given | digits.write) & (drilled.run == len(drilled.runs) - 1))
    if put.size:
        kept[letter] = int(digits.mantissa[put[-1]]) / 10 ** int(digits.decimals[put[-1]])
    return digits


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
