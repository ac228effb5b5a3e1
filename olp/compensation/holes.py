"""Canned cycles, corrected per hole: X, Y, Z and R words of each block.

A cycle moves straight along the tool axis. In the plane it is commanded where the middle of its feed stroke
is exact, along the tool axis where its bottom and its R level are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from olp.compensation.invert import invert
from olp.compensation.plan import Plan
from olp.core.arrays import Array
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag
from olp.errormodel.base import ErrorModel
from olp.program.program import Hole, Program
from olp.program.text.edits import EditList, Edits

if TYPE_CHECKING:
    from olp.compensation.rows import Rows
    from olp.compensation.writer import Writer


@dataclass(frozen=True, slots=True, eq=False)
class HolePlan:
    """(h, 3) commands at the R level and at the bottom of each hole, and how far its stroke leans (h,), in
    mm."""

    holes: tuple[Hole, ...]
    level_mm: Array
    bottom_mm: Array
    lean_mm: Array

    @staticmethod
    def of(program: Program, plan: Plan, model: ErrorModel) -> HolePlan:
        path, holes = program.toolpath, program.holes
        count = len(holes)
        level, bottom = np.zeros((count, 3)), np.zeros((count, 3))
        tools = path.tools_mm()
        tool, shift = np.zeros((count, tools.shape[1])), np.zeros((count, 3))
        for i, hole in enumerate(holes):
            first, second, third = PLANES[hole.plane]
            for point, depth in ((level, hole.r_mm), (bottom, hole.z_mm)):
                point[i, first], point[i, second], point[i, third] = *hole.place_mm, depth
            frame = int(path.frame[hole.first])
            tool[i], shift[i] = tools[frame], plan.shift_mm[frame]
        if not count:
            return HolePlan(holes, level, bottom, np.zeros(0))
        level_play, bottom_play = _play(program, plan)
        c_level = invert(model, level + shift, tool, level_play)
        c_bottom = invert(model, bottom + shift, tool, bottom_play)
        # the stroke does not turn the axes of the plane, so its lean is that of the error alone
        lean = np.abs(invert(model, level + shift, tool) - invert(model, bottom + shift, tool)) / 2
        for i, hole in enumerate(holes):
            lean[i, PLANES[hole.plane][2]] = 0.0
            off = np.array([bool(path.flag[hole.first] & np.uint8(Flag.PASS))])
            if off[0]:
                c_level[i], c_bottom[i] = level[i], bottom[i]
        return HolePlan(holes, c_level, c_bottom, np.sqrt((lean * lean).sum(axis=1)))


def _play(program: Program, plan: Plan) -> tuple[Array | None, Array | None]:
    """(h, 3) play of the axes when a hole's R level and its bottom are reached."""
    if plan.play is None:
        return None, None
    path = program.toolpath
    rows = np.zeros((2, len(program.holes)), np.int64)
    for i, hole in enumerate(program.holes):
        depth = path.end_mm[hole.first : hole.last, PLANES[hole.plane][2]]
        level = np.flatnonzero(depth == hole.r_mm)
        bottom = np.flatnonzero(depth == hole.z_mm)
        moves = hole.first + (level[:1] if level.size else bottom[:1]), hole.first + bottom[-1:]
        rows[:, i] = [int(np.searchsorted(plan.move, m[0])) if m.size else 0 for m in moves]
    return plan.play[rows[0]], plan.play[rows[1]]


def hole_edits(writer: Writer, rows: Rows, a: int, b: int) -> list[Edits]:
    """Edits of the cycle block whose moves are rows a..b, and the positions after it.

    Repeats of a block in G91 share its words but not their corrections: they are written out, one block a
    hole.
    """
    plan = writer.holes
    edits = EditList(writer.prefixes)
    index = writer.hole_of[int(rows.move[a])]
    first = int(rows.move[a])
    while index < len(plan.holes) and plan.holes[index].first <= int(rows.move[b - 1]):
        hole = plan.holes[index]
        _hole(writer, rows, index, a + hole.first - first, a + hole.last - first, edits)
        index += 1
    return [edits.done()]


def _hole(writer: Writer, rows: Rows, index: int, a: int, b: int, edits: EditList) -> None:
    plan = writer.holes
    hole = plan.holes[index]
    if b <= a:
        return
    first, second, third = PLANES[hole.plane]
    frame = writer.frame_of(hole.first)
    before = rows.emitted[a - 1].copy() if a else rows.entry.copy()
    if rows.flag[a] & np.uint8(Flag.PASS):
        rows.emitted[a:b] = writer.path.end_mm[hole.last - 1]
        return
    if writer.series != hole.series:
        writer.series, writer.initial = hole.series, float(before[third])
        writer.sticky = {}
    out = _Words(writer, hole, edits)
    command = (plan.level_mm[index] + plan.bottom_mm[index]) / 2
    emitted = before.copy()
    for axis in (first, second):
        base = before[axis] if hole.incremental else frame.offset_mm[axis]
        slot = out.slot("XYZ"[axis])
        decimals = _decimals(writer, slot, axis, frame.unit_mm)
        mantissa = round((command[axis] - base) / frame.unit_mm * 10**decimals)
        moved = abs(command[axis] - before[axis]) > 0.5 * 10.0**-decimals * frame.unit_mm * (1 + 1e-9)
        if slot is not None or moved:
            emitted[axis] = base + mantissa / 10**decimals * frame.unit_mm
            out.put("XYZ"[axis], axis, mantissa, decimals)
    r_base = writer.initial if hole.incremental else frame.offset_mm[third]
    r_place = _depth(writer, out, "R", plan.level_mm[index][third], r_base, third, frame.unit_mm)
    z_base = r_place if hole.incremental else frame.offset_mm[third]
    _depth(writer, out, "XYZ"[third], plan.bottom_mm[index][third], z_base, third, frame.unit_mm)
    out.finish()
    retract_to_r = abs(writer.path.end_mm[hole.last - 1, third] - hole.r_mm) < 1e-9
    emitted[third] = r_place if retract_to_r else max(writer.initial, r_place)
    rows.emitted[a:b] = emitted


class _Words:
    """Where a hole's words go: into its block, or, for the later repeats in G91, into a block of their
    own."""

    def __init__(self, writer: Writer, hole: Hole, edits: EditList) -> None:
        self.writer, self.hole, self.edits = writer, hole, edits
        self.unit = writer.frame_of(hole.first).unit_mm
        self.own_block = hole.incremental and hole.repeat > 0
        words = {k: v for k, v in hole.words.items() if k in "XYZR"} or hole.words
        self.anchor = max(words.values())
        self.new: list[tuple[str, int, int]] = []
        counter = writer.program.rs274.cycles.counter(hole.words)
        if hole.incremental and hole.repeats > 1 and hole.repeat == 0 and counter is not None:
            edits.add(int(writer.words.number[counter]), int(writer.words.end[counter]), 1, 0)

    def slot(self, letter: str) -> int | None:
        return None if self.own_block else self.hole.words.get(letter)

    def put(self, letter: str, axis: int, mantissa: int, decimals: int) -> None:
        """Replace the word, or insert it."""
        slot = self.slot(letter)
        if slot is None:
            self.new.append((letter, mantissa, decimals))
            return
        words = self.writer.words
        own = self.writer.style.decimals_of(slot, axis, self.unit)
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
        lead = writer.block_start(self.hole.line)
        if not self.new:
            # a repeat without any step makes the same hole again
            self.new = [("X", 0, 0)]
        for i, (letter, mantissa, decimals) in enumerate(self.new):
            self.edits.add(
                place, place, mantissa, decimals, lead + letter.encode(), self.hole.repeat * 8 + 16 + i
            )
            lead = b" "
        writer.tally.inserted_blocks += 1


def _depth(
    writer: Writer, out: _Words, letter: str, wanted: float, base: float, axis: int, unit: float
) -> float:
    """R or the depth word: replaced where given, inserted where the inherited value would be wrong. Returns
    where the axis then is."""
    slot = out.slot(letter)
    decimals = _decimals(writer, slot, axis, unit)
    mantissa = round((wanted - base) / unit * 10**decimals)
    held = writer.sticky.get(letter)
    half = 0.5 * 10.0**-decimals * unit * (1 + 1e-9)
    if slot is None and held is not None and abs(wanted - base - held * unit) <= half:
        return float(base + held * unit)
    out.put(letter, axis, mantissa, decimals)
    writer.sticky[letter] = mantissa / 10**decimals
    return float(base + mantissa / 10**decimals * unit)


def _decimals(writer: Writer, slot: int | None, axis: int, unit: float) -> int:
    if slot is None:
        return writer.style.usual(axis, unit)
    return max(writer.style.decimals_of(slot, axis, unit), writer.style.least(axis, unit))
