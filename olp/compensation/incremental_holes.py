"""Canned cycles in G91, corrected block by block: each hole counts from the one before as written.

Repeats of a block share its words but not their corrections: where these differ by more than a digit they
are unrolled, one block per hole.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from olp.compensation.digits import NO_CHANGE
from olp.compensation.hole_plan import HolePlan
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.holes import Hole
from olp.program.text.edits import EditList

#: a level that no hole has, so that it is written
_NO_LEVEL = 1e9


@dataclass(slots=True)
class SeriesWords:
    """What blocks of the present series take over as it is written: R and the depth by their letters,
    `initial`, the program coordinate of the tool axis before the series, and its number. `incremental`: the
    blocks are in G91, None before any. `turned`: R and depth were written in the other mode."""

    number: int = -1
    initial: float = 0.0
    inherited: dict[str, float] = field(default_factory=dict)
    incremental: bool | None = None
    turned: bool = False

    def go_on(self, incremental: bool, depth: str, *, levels_stay: bool) -> None:
        """Go on in G91 or G90. Where levels stay, the numbers become those of the new mode."""
        turns = self.incremental is not None and self.incremental is not incremental
        self.incremental = incremental
        if not turns or not levels_stay or not {"R", depth} <= self.inherited.keys():
            return
        r, z = self.inherited["R"], self.inherited[depth]
        if incremental:
            r, z = r - self.initial, z - r
        else:
            r, z = self.initial + r, self.initial + r + z
        self.inherited |= {"R": r, depth: z}
        self.turned = not self.turned

    def restate(self) -> None:
        """R and depth are written together next."""
        self.inherited = dict.fromkeys(self.inherited, _NO_LEVEL)
        self.turned = False


def incremental_block(
    writer: Writer, rows: Rows, series: SeriesWords, index: int, a: int, edits: EditList
) -> None:
    """Edit the block in G91 that begins with hole `index`, whose rows begin at `a`; the rows then hold the
    positions after its holes."""
    holes = writer.holes.holes
    step = _hole(writer, rows, series, index, a, edits)
    later = np.arange(index + 1, index + int(holes.repeats[index]))
    begin = (a + holes.first[later] - holes.first[index]).tolist()
    for i, row in zip(later.tolist(), begin, strict=True):
        if step is None:
            _hole(writer, rows, series, i, row, edits)
        else:
            place = rows.emitted[row - 1] + writer.along_axes(step[None], writer.turn_of(rows)[row])[0]
            rows.emitted[row : row + int(holes.last[i] - holes.first[i])] = place


def _hole(
    writer: Writer, rows: Rows, series: SeriesWords, index: int, a: int, edits: EditList
) -> Array | None:
    """Edit one hole. Returns the way (3,) to the next one of the block where the words are right for all of
    them, None where each gets a block of its own."""
    plan = writer.holes
    hole = plan.holes[index]
    first, second, third = PLANES[hole.plane]
    frame = writer.frame_of(hole.first)
    turn = writer.turn_of(rows)[a]
    before = writer.along_words((rows.emitted[a - 1] if a else rows.entry)[None], turn)[0]
    initial = series.initial * frame.unit_mm + frame.offset_mm[third]
    words = _Words(writer, hole, frame.unit_mm, edits)
    command = (plan.level_mm[index] + plan.bottom_mm[index]) / 2
    emitted = before.copy()
    for axis in (first, second):
        slot = words.slot("XYZ"[axis])
        mantissa, decimals = words.number(slot, axis, command[axis] - before[axis])
        if slot is not None or abs(command[axis] - before[axis]) > words.half(decimals):
            emitted[axis] = before[axis] + mantissa / 10**decimals * frame.unit_mm
            words.put("XYZ"[axis], axis, mantissa, decimals)
    step = None if hole.repeat else _shared_step(words, plan, index, before, emitted)
    if not hole.repeat and step is None:
        words.unroll()
    r_place = _depth(words, series, "R", plan.level_mm[index][third], initial, third)
    _depth(words, series, "XYZ"[third], plan.bottom_mm[index][third], r_place, third)
    words.finish()
    retract_to_r = abs(writer.path.end_mm[hole.last - 1, third] - hole.r_mm) < 1e-9
    emitted[third] = r_place if retract_to_r else max(initial, r_place)
    rows.emitted[a : a + hole.last - hole.first] = writer.along_axes(emitted[None], turn)[0]
    return step


def _shared_step(words: _Words, plan: HolePlan, index: int, before: Array, after: Array) -> Array | None:
    """(3,) the way from repeat to repeat, where the words of the block are right for all of them."""
    hole = plan.holes[index]
    if hole.repeats == 1:
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


def restates(writer: Writer, series: SeriesWords, i: int, j: int) -> bool:
    """Whether holes i..j, a run in G91 whose R and depth were written in G90, need others than they take
    over, or state both themselves."""
    plan = writer.holes
    hole = plan.holes[i]
    third = PLANES[hole.plane][2]
    frame, depth = writer.frame_of(hole.first), "XYZ"[third]
    if {"R", depth} <= hole.words.keys():
        return True
    unit = frame.unit_mm
    half = 0.5 * 10.0 ** -writer.style.usual(third, unit) * unit * (1 + 1e-9)
    base = series.initial * unit + frame.offset_mm[third]
    for letter, levels in (("R", plan.level_mm), (depth, plan.bottom_mm)):
        base += series.inherited[letter] * unit
        if np.abs(levels[i:j, third] - base).max() > half:
            return True
    return False


def _depth(words: _Words, series: SeriesWords, letter: str, wanted: float, base: float, axis: int) -> float:
    """R or the depth word: replaced where given, inserted where the inherited value would be wrong.
    Returns where the axis then is."""
    unit = words.unit_mm
    slot = words.slot(letter)
    mantissa, decimals = words.number(slot, axis, wanted - base)
    held = series.inherited.get(letter)
    if slot is None and held is not None and abs(wanted - base - held * unit) <= words.half(decimals):
        return float(base + held * unit)
    words.put(letter, axis, mantissa, decimals)
    series.inherited[letter] = mantissa / 10**decimals
    return float(base + mantissa / 10**decimals * unit)


class _Words:
    """Where a hole's words go: into its block or, for the later repeats, into a new block."""

    def __init__(self, writer: Writer, hole: Hole, unit_mm: float, edits: EditList) -> None:
        self.writer, self.hole, self.unit_mm, self.edits = writer, hole, unit_mm, edits
        self.own_block = hole.repeat > 0
        self.anchor = max(hole.words.values(), default=hole.last_word)
        self.new: list[tuple[str, int, int]] = []

    def unroll(self) -> None:
        """Let the block make one hole: the others get blocks of their own."""
        words, counter = self.writer.words, self.hole.counter
        if counter >= 0:
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
