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
from olp.errormodel import ErrorModel
from olp.errormodel.base import Array
from olp.exceptions import ProgramError
from olp.program.edits import Edits
from olp.program.program import Hole, Program
from olp.geometry import PLANES
from olp.toolpath import Flag

if TYPE_CHECKING:
    from olp.compensation.writer import Rows, Writer


@dataclass(frozen=True, slots=True, eq=False)
class HolePlan:
    """(h, 3) commands at the R level and at the bottom of each hole, and how far its stroke leans (h,), in mm."""

    holes: tuple[Hole, ...]
    level_mm: Array
    bottom_mm: Array
    lean_mm: Array

    @staticmethod
    def of(program: Program, plan: Plan, model: ErrorModel, tolerance_mm: float) -> HolePlan:
        path, holes = program.toolpath, program.holes
        count = len(holes)
        level, bottom = np.zeros((count, 3)), np.zeros((count, 3))
        tool, shift = np.zeros((count, 3)), np.zeros((count, 3))
        for i, hole in enumerate(holes):
            first, second, third = PLANES[hole.plane]
            for point, depth in ((level, hole.r_mm), (bottom, hole.z_mm)):
                point[i, first], point[i, second], point[i, third] = *hole.place_mm, depth
            frame = int(path.frame[hole.first])
            tool[i], shift[i] = path.frames[frame].tool_mm, plan.shift_mm[frame]
        if not count:
            return HolePlan(holes, level, bottom, np.zeros(0))
        c_level, _ = invert(model, level + shift, tool)
        c_bottom, _ = invert(model, bottom + shift, tool)
        lean = np.abs(c_level - c_bottom) / 2
        for i, hole in enumerate(holes):
            lean[i, PLANES[hole.plane][2]] = 0.0
            off = np.array([bool(path.flag[hole.first] & np.uint8(Flag.PASS))])
            if off[0]:
                c_level[i], c_bottom[i] = level[i], bottom[i]
            if hole.repeats > 1 and hole.incremental:
                _check_repeats(program, plan, model, hole, c_bottom[i] - bottom[i], tolerance_mm)
        return HolePlan(holes, c_level, c_bottom, np.sqrt((lean * lean).sum(axis=1)))


def _check_repeats(
    program: Program, plan: Plan, model: ErrorModel, hole: Hole, correction: Array, tolerance_mm: float
) -> None:
    """Repeats of one block share its words, so they must need the same correction."""
    path = program.toolpath
    part = slice(hole.first, hole.last)
    frame = path.frames[int(path.frame[hole.first])]
    target = path.end_mm[part] + plan.shift_mm[int(path.frame[hole.first])]
    command, _ = invert(model, target, np.array(frame.tool_mm))
    spread = np.abs(command - path.end_mm[part] - correction).max()
    if spread > tolerance_mm:
        raise ProgramError(
            f"a cycle with L{hole.repeats} makes holes that need different corrections ({spread * 1e3:.1f} um apart); "
            "write the cycles out with --expand-cycles",
            line=hole.line,
        )


def hole_edits(writer: Writer, rows: Rows, a: int, b: int) -> list[Edits]:
    """Edits of the cycle block whose moves are rows a..b, and the positions after it."""
    plan = writer.holes
    move = int(rows.move[a])
    index = writer.hole_of[move]
    hole = plan.holes[index]
    first, second, third = PLANES[hole.plane]
    frame = writer.frame_of(move)
    before = rows.emitted[a - 1].copy() if a else rows.entry.copy()
    if writer.series != hole.series:
        writer.series, writer.initial = hole.series, float(before[third])
        writer.sticky = {}
    command = (plan.level_mm[index] + plan.bottom_mm[index]) / 2
    emitted = before.copy()
    out: list[Edits] = []
    anchor = max(hole.words[k] for k in hole.words if k in "XYZR") if set(hole.words) & set("XYZR") else None
    if anchor is None:
        anchor = max(hole.words.values())
    for axis in (first, second):
        slot = hole.words.get("XYZ"[axis])
        decimals = _decimals(writer, slot, axis, frame.unit_mm)
        base = before[axis] if hole.incremental else frame.offset_mm[axis]
        mantissa = round((command[axis] - base) / frame.unit_mm * 10**decimals)
        place = base + mantissa / 10**decimals * frame.unit_mm
        if hole.incremental and slot is not None and hole.repeats > 1:
            # every repeat steps by the word, so it stays as it is, and the start carries the correction
            place = before[axis] + hole.repeats * _word(writer, slot, axis) * frame.unit_mm
        elif slot is not None:
            out += _replace(writer, slot, axis, mantissa, decimals)
        elif abs(command[axis] - before[axis]) > 0.5 * 10.0**-decimals * frame.unit_mm * (1 + 1e-9):
            out.append(_insert(writer, anchor, "XYZ"[axis], mantissa, decimals, axis + 1))
        else:
            place = before[axis]
        emitted[axis] = place
    r_base = writer.initial if hole.incremental else frame.offset_mm[third]
    r_place, r_edits = _depth(writer, hole, "R", plan.level_mm[index][third], r_base, third, anchor, frame.unit_mm, 8)
    z_base = r_place if hole.incremental else frame.offset_mm[third]
    _, z_edits = _depth(
        writer, hole, "XYZ"[third], plan.bottom_mm[index][third], z_base, third, anchor, frame.unit_mm, third + 1
    )
    out += r_edits + z_edits
    retract_to_r = abs(writer.path.end_mm[hole.last - 1, third] - hole.r_mm) < 1e-9
    emitted[third] = r_place if retract_to_r else max(writer.initial, r_place)
    rows.emitted[a:b] = emitted
    return out


def _depth(
    writer: Writer, hole: Hole, letter: str, wanted: float, base: float, axis: int, anchor: int, unit: float, order: int
) -> tuple[float, list[Edits]]:
    """R or the depth word: replaced where given, inserted where the inherited value would be wrong."""
    slot = hole.words.get(letter)
    decimals = _decimals(writer, slot, axis, unit)
    mantissa = round((wanted - base) / unit * 10**decimals)
    edits: list[Edits] = []
    held = writer.sticky.get(letter)
    if slot is not None:
        edits = _replace(writer, slot, axis, mantissa, decimals)
        if not edits:
            mantissa = round(_word(writer, slot, axis) * 10**decimals)
    elif held is not None and abs(wanted - base - held * unit) <= 0.5 * 10.0**-decimals * unit * (1 + 1e-9):
        return base + held * unit, []
    else:
        edits = [_insert(writer, anchor, letter, mantissa, decimals, order)]
    writer.sticky[letter] = mantissa / 10**decimals
    return base + mantissa / 10**decimals * unit, edits


def _decimals(writer: Writer, slot: int | None, axis: int, unit: float) -> int:
    if slot is None:
        return writer.style.usual(axis, unit)
    own = int(writer.style.decimals(np.array([slot]), axis)[0])
    return max(own, writer.style.least(axis, unit))


def _word(writer: Writer, slot: int, axis: int) -> float:
    return float(writer.words.mantissa[slot]) / 10.0 ** int(writer.style.decimals(np.array([slot]), axis)[0])


def _replace(writer: Writer, slot: int, axis: int, mantissa: int, decimals: int) -> list[Edits]:
    own = int(writer.style.decimals(np.array([slot]), axis)[0])
    if int(writer.words.mantissa[slot]) * 10 ** (decimals - own) == mantissa:
        return []
    writer.tally.changed_words += 1
    return [writer.one(int(writer.words.number[slot]), int(writer.words.end[slot]), mantissa, decimals, b"", 0)]


def _insert(writer: Writer, anchor: int, letter: str, mantissa: int, decimals: int, order: int) -> Edits:
    style = int(writer.style.separators(np.array([anchor]), writer.program)[0])
    text = (b"", b" ", b"\t")[style % 3] + (letter.lower() if style >= 3 else letter).encode()
    place = int(writer.words.end[anchor])
    writer.tally.inserted_words += 1
    return writer.one(place, place, mantissa, decimals, text, order)
