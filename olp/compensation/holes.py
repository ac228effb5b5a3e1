"""Canned cycles, corrected per hole: X, Y, Z and R words of each block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.compensation.digits import NO_CHANGE
from olp.compensation.hole_plan import HolePlan
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag
from olp.program.program import Hole
from olp.program.text.edits import EditList, Edits


class HoleWords:
    """Words of the holes of one program, in the order of its rows. A block of a series inherits R and Z of
    the block before, as they are written."""

    def __init__(self, holes: Sequence[Hole]) -> None:
        self._hole_of = {m: i for i, hole in enumerate(holes) for m in range(hole.first, hole.last)}
        self._series = -1
        # program coordinate of the tool axis before the series
        self._initial = 0.0
        self._inherited: dict[str, float] = {}
        # mm from one repeat of the present block to the next, None where each has a block of its own
        self._step: Array | None = None

    def edits(self, writer: Writer, rows: Rows, a: int, b: int) -> list[Edits]:
        """Edits of the cycle block whose moves are rows a..b, and the positions after it.

        Repeats of a block in G91 share its words but not their corrections: where these differ by more than
        a digit they are unrolled, one block per hole.
        """
        holes = writer.program.holes
        edits = EditList(writer.prefixes)
        first, last = int(rows.move[a]), int(rows.move[b - 1])
        index = self._hole_of[first]
        while index < len(holes) and holes[index].first <= last:
            hole = holes[index]
            self._hole(writer, rows, index, a + hole.first - first, a + hole.last - first, edits)
            index += 1
        return [edits.done()]

    def _hole(self, writer: Writer, rows: Rows, index: int, a: int, b: int, edits: EditList) -> None:
        plan = writer.holes
        hole = plan.holes[index]
        if b <= a:
            return
        first, second, third = PLANES[hole.plane]
        frame = writer.frame_of(hole.first)
        before = rows.emitted[a - 1].copy() if a else rows.entry.copy()
        if self._series != hole.series:
            self._series = hole.series
            self._initial = float(before[third] - frame.offset_mm[third]) / frame.unit_mm
            self._inherited = {}
        if rows.flag[a] & np.uint8(Flag.PASS):
            rows.emitted[a:b] = writer.path.end_mm[hole.last - 1]
            self._inherit(writer, hole, third, frame.unit_mm)
            return
        if hole.repeat and self._step is not None:
            rows.emitted[a:b] = before + self._step
            return
        initial = self._initial * frame.unit_mm + frame.offset_mm[third]
        words = _Words(writer, hole, frame.unit_mm, edits)
        command = (plan.level_mm[index] + plan.bottom_mm[index]) / 2
        emitted = before.copy()
        for axis in (first, second):
            base = before[axis] if hole.incremental else frame.offset_mm[axis]
            slot = words.slot("XYZ"[axis])
            mantissa, decimals = words.number(slot, axis, command[axis] - base)
            if slot is not None or abs(command[axis] - before[axis]) > words.half(decimals):
                emitted[axis] = base + mantissa / 10**decimals * frame.unit_mm
                words.put("XYZ"[axis], axis, mantissa, decimals)
        if not hole.repeat:
            self._step = self._shared_step(words, plan, index, before, emitted)
            if self._step is None:
                words.unroll()
        r_base = initial if hole.incremental else frame.offset_mm[third]
        r_place = self._depth(words, "R", plan.level_mm[index][third], r_base, third)
        z_base = r_place if hole.incremental else frame.offset_mm[third]
        self._depth(words, "XYZ"[third], plan.bottom_mm[index][third], z_base, third)
        words.finish()
        retract_to_r = abs(writer.path.end_mm[hole.last - 1, third] - hole.r_mm) < 1e-9
        emitted[third] = r_place if retract_to_r else max(initial, r_place)
        rows.emitted[a:b] = emitted

    def _shared_step(
        self, words: _Words, plan: HolePlan, index: int, before: Array, after: Array
    ) -> Array | None:
        """(3,) the way from repeat to repeat, where the words of the block are right for all of them."""
        hole = plan.holes[index]
        if not hole.incremental or hole.repeats == 1:
            return np.zeros(3)
        step = after - before
        mine = slice(index, index + hole.repeats)
        middle = (plan.level_mm[mine] + plan.bottom_mm[mine]) / 2
        for axis in PLANES[hole.plane][:2]:
            decimals = words.decimals(words.slot("XYZ"[axis]), axis)
            reached = before[axis] + step[axis] * np.arange(1, hole.repeats + 1)
            if np.abs(middle[:, axis] - reached).max() > words.half(decimals):
                return None
        third = PLANES[hole.plane][2]
        for letter, depth in (("R", plan.level_mm[mine, third]), ("XYZ"[third], plan.bottom_mm[mine, third])):
            if np.ptp(depth) > words.half(words.decimals(words.slot(letter), third)):
                return None
        return np.where(np.arange(3) == third, 0.0, step)

    def _inherit(self, writer: Writer, hole: Hole, third: int, unit_mm: float) -> None:
        """Take over R and the depth of a block that stays as it is."""
        for letter in ("R", "XYZ"[third]):
            if letter in hole.words:
                slot = hole.words[letter]
                decimals = writer.style.decimals_of(slot, third, unit_mm)
                self._inherited[letter] = int(writer.words.mantissa[slot]) / 10**decimals

    def _depth(self, words: _Words, letter: str, wanted: float, base: float, axis: int) -> float:
        """R or the depth word: replaced where given, inserted where the inherited value would be wrong.
        Returns where the axis then is."""
        unit = words.unit_mm
        slot = words.slot(letter)
        mantissa, decimals = words.number(slot, axis, wanted - base)
        held = self._inherited.get(letter)
        if slot is None and held is not None and abs(wanted - base - held * unit) <= words.half(decimals):
            return float(base + held * unit)
        words.put(letter, axis, mantissa, decimals)
        self._inherited[letter] = mantissa / 10**decimals
        return float(base + mantissa / 10**decimals * unit)


class _Words:
    """Where a hole's words go: into its block or, for the later repeats in G91, into a new block."""

    def __init__(self, writer: Writer, hole: Hole, unit_mm: float, edits: EditList) -> None:
        self.writer, self.hole, self.unit_mm, self.edits = writer, hole, unit_mm, edits
        self.own_block = hole.incremental and hole.repeat > 0
        words = {k: v for k, v in hole.words.items() if k in "XYZR"} or hole.words
        self.anchor = max(words.values())
        self.new: list[tuple[str, int, int]] = []

    def unroll(self) -> None:
        """Let the block make one hole: the others get blocks of their own."""
        words = self.writer.words
        counter = self.writer.program.rs274.cycles.counter(self.hole.words)
        if counter is not None:
            self.edits.add(int(words.number[counter]), int(words.end[counter]), 1, 0)

    def slot(self, letter: str) -> int | None:
        return None if self.own_block else self.hole.words.get(letter)

    def decimals(self, slot: int | None, axis: int) -> int:
        """Digits of a word behind the point; of an inserted one where there is no slot."""
        style = self.writer.style
        if slot is None:
            return style.usual(axis, self.unit_mm)
        return max(style.decimals_of(slot, axis, self.unit_mm), style.least(axis, self.unit_mm))

    def half(self, decimals: int) -> float:
        """Half a digit in mm."""
        return 0.5 * 10.0**-decimals * self.unit_mm * (1 + 1e-9)

    def number(self, slot: int | None, axis: int, value_mm: float) -> tuple[int, int]:
        """Mantissa and decimals of a value; those of the word where it says the same."""
        decimals = self.decimals(slot, axis)
        if slot is not None:
            own = self.writer.style.decimals_of(slot, axis, self.unit_mm)
            stated = int(self.writer.words.mantissa[slot]) * 10 ** (decimals - own)
            if abs(value_mm / self.unit_mm - stated / 10**decimals) <= NO_CHANGE:
                return stated, decimals
        return round(value_mm / self.unit_mm * 10**decimals), decimals

    def put(self, letter: str, axis: int, mantissa: int, decimals: int) -> None:
        """Replace the word, or insert it."""
        slot = self.slot(letter)
        if slot is None:
            self.new.append((letter, mantissa, decimals))
            return
        words = self.writer.words
        own = self.writer.style.decimals_of(slot, axis, self.unit_mm)
        if int(words.mantissa[slot]) * 10 ** (decimals - own) != mantissa:
            self.edits.add(int(words.number[slot]), int(words.end[slot]), mantissa, decimals)
            self.writer.tally.changed_words += 1

    def finish(self) -> None:
        writer, style = self.writer, self.writer.style
        if not self.own_block:
            place = int(writer.words.end[self.anchor])
            for i, (letter, mantissa, decimals) in enumerate(self.new):
                text = style.lead(self.anchor) + style.cased(self.anchor, letter.encode())
                self.edits.add(place, place, mantissa, decimals, text, i + 1)
                writer.tally.inserted_words += 1
            return
        place = int(writer.program.line_end[self.hole.line - 1])
        lead = style.block_start(self.hole.line)
        if not self.new:
            # a repeat without any step makes the same hole again
            self.new = [("X", 0, 0)]
        for i, (letter, mantissa, decimals) in enumerate(self.new):
            self.edits.add(
                place, place, mantissa, decimals, lead + letter.encode(), self.hole.repeat * 8 + 16 + i
            )
            lead = b" "
        writer.tally.inserted_blocks += 1
