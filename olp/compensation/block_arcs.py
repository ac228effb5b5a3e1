"""Arcs of programs of blocks: centre, radius and turn words, and blocks for the later parts of arcs."""

from __future__ import annotations

import numpy as np

from olp.compensation.arc_centres import Arc, ArcRows, solve
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind
from olp.program.text.edits import EditList, Edits

#: (3, 3) axes of each plane: first, second, third.
_AXES = np.array(PLANES)


def arc_edits(writer: Writer, rows: Rows) -> list[Edits]:
    """Edits of I, J, K, R and P for the arc rows of a chunk, and whole blocks for their later parts."""
    if not rows.arc.any():
        return []
    solved = solve(writer, rows)
    plain = _is_plain(writer, rows, solved)
    edits = EditList(writer.prefixes)
    for i in np.flatnonzero(~plain).tolist():
        arc = solved.one(i)
        (_head if rows.head[arc.row] else _tail)(writer, rows, arc, edits)
    return [edits.done(), *_plain_words(writer, solved.pick(plain))]


def _is_plain(writer: Writer, rows: Rows, arcs: ArcRows) -> Mask:
    """Arcs that keep their block and both its centre words: nearly all arcs."""
    index = np.searchsorted(writer.path.arcs.move, arcs.move)
    slots = writer.program.arc_slots.word[index]
    lone = np.arange(len(arcs.row))
    both = (slots[lone, _AXES[arcs.plane][:, 0]] >= 0) & (slots[lone, _AXES[arcs.plane][:, 1]] >= 0)
    following = np.minimum(arcs.row + 1, len(rows.move) - 1)
    split = (following > arcs.row) & (rows.move[following] == arcs.move)
    plain = (
        both & (slots[:, 3] < 0) & ~split & rows.head[arcs.row] & ~writer.program.arc_slots.absolute[index]
    )
    return np.asarray(plain, bool)


def _plain_words(writer: Writer, arcs: ArcRows) -> list[Edits]:
    """Centre words of many arcs at once."""
    words, style = writer.words, writer.style
    index = np.searchsorted(writer.path.arcs.move, arcs.move)
    unit = writer.frame_unit_mm[writer.path.frame[arcs.move]]
    edits = []
    for k in (0, 1):
        for axis in range(3):
            mine = np.flatnonzero(_AXES[arcs.plane][:, k] == axis)
            if not mine.size:
                continue
            slot = writer.program.arc_slots.word[index[mine], axis]
            own = style.decimals(slot, axis, unit[mine])
            fewest = {u: style.centre(axis, u) for u in np.unique(unit[mine]).tolist()}
            decimals = np.maximum(own, np.array([fewest[u] for u in unit[mine].tolist()]))
            away = (arcs.centre[mine, axis] - arcs.start[mine, axis]) / unit[mine]
            mantissa = np.rint(away * 10.0**decimals).astype(np.int64)
            new = np.flatnonzero(mantissa != words.mantissa[slot] * 10 ** (decimals - own))
            zero = np.zeros(len(new), np.int32)
            edits.append(
                Edits(
                    words.number[slot[new]].astype(np.int64), words.end[slot[new]].astype(np.int64),
                    mantissa[new], decimals[new].astype(np.int8), zero, zero,
                )
            )  # fmt: skip
            writer.tally.changed_words += len(new)
    return edits


def _centre_words(
    writer: Writer, arc: Arc, absolute: bool, own: dict[int, int]
) -> list[tuple[int, int, int]]:
    """(axis, mantissa, decimals) of both centre words, with at least the digits of the program's `own`
    words."""
    frame = writer.frame_of(arc.move)
    words = []
    for axis in PLANES[arc.plane][:2]:
        base = frame.offset_mm[axis] if absolute else arc.start[axis]
        decimals = max(writer.style.centre(axis, frame.unit_mm), own.get(axis, 0))
        mantissa = round((arc.centre[axis] - base) / frame.unit_mm * 10**decimals)
        words.append((axis, mantissa, decimals))
    return words


def _head(writer: Writer, rows: Rows, arc: Arc, edits: EditList) -> None:
    """The part that keeps the block's own line: its centre words replaced, or inserted where omitted."""
    program, words, style = writer.program, writer.words, writer.style
    index = int(np.searchsorted(writer.path.arcs.move, arc.move))
    slots = program.arc_slots.word[index].tolist()
    absolute = bool(program.arc_slots.absolute[index])
    split = arc.row + 1 < len(rows.move) and rows.move[arc.row + 1] == arc.move
    if split and slots[4] >= 0:
        edits.add(int(words.number[slots[4]]), int(words.end[slots[4]]), _turns(arc), 0)
    if slots[3] >= 0:
        _radius_word(writer, arc, slots[3], edits)
        return
    unit = writer.frame_of(arc.move).unit_mm
    own = {axis: style.decimals_of(slots[axis], axis, unit) for axis in range(3) if slots[axis] >= 0}
    for axis, mantissa, decimals in _centre_words(writer, arc, absolute, own):
        slot = slots[axis]
        if slot >= 0:
            if mantissa != int(words.mantissa[slot]) * 10 ** (decimals - own[axis]):
                edits.add(int(words.number[slot]), int(words.end[slot]), mantissa, decimals)
                writer.tally.changed_words += 1
        elif abs(mantissa) > 10 ** (decimals - style.usual(axis, unit)) // 2:
            present = [s for s in slots[:3] if s >= 0]
            anchor = max(present) if present else style.last_word(arc.line)
            place = int(words.end[anchor])
            prefix = style.lead(anchor) + style.cased(anchor, b"IJK"[axis : axis + 1])
            edits.add(place, place, mantissa, decimals, prefix, 5 + axis)
            writer.tally.inserted_words += 1


def _turns(arc: Arc) -> int:
    """The P word that an arc of this sweep needs."""
    return int((abs(arc.sweep) - 1e-6) // (2 * np.pi)) + 1


def _radius_word(writer: Writer, arc: Arc, slot: int, edits: EditList) -> None:
    """R of the corrected arc; where R is too coarse (near half circles), I, J, K in its place."""
    words, style = writer.words, writer.style
    first, second, _ = PLANES[arc.plane]
    unit = writer.frame_of(arc.move).unit_mm
    radius = float(np.hypot(arc.start[first] - arc.centre[first], arc.start[second] - arc.centre[second]))
    half = float(np.hypot(arc.end[first] - arc.start[first], arc.end[second] - arc.start[second])) / 2
    own = style.decimals_of(slot, first, unit)
    decimals = max(own, style.centre(first, unit))
    sign = -1 if abs(arc.sweep) > np.pi else 1
    mantissa = sign * round(radius / unit * 10**decimals)
    size = abs(mantissa) / 10**decimals * unit
    start, end = int(words.start[slot]), int(words.end[slot])
    writer.tally.changed_words += 1
    if size > half:
        # how far R as written puts the centre from where it should be
        dx, dy = arc.end[first] - arc.start[first], arc.end[second] - arc.start[second]
        lean = (
            (1.0 if (arc.sweep > 0) == (sign > 0) else -1.0) * np.sqrt(size * size - half * half) / (2 * half)
        )
        off = np.hypot(
            arc.start[first] + dx / 2 - lean * dy - arc.centre[first],
            arc.start[second] + dy / 2 + lean * dx - arc.centre[second],
        )
        if off < 0.5 * 10.0**-decimals * unit + 0.1 * writer.tolerance_mm:
            if mantissa == int(words.mantissa[slot]) * 10 ** (decimals - own):
                writer.tally.changed_words -= 1
            else:
                edits.add(int(words.number[slot]), end, mantissa, decimals)
            return
    letters = style.cased(slot, b"IJK")
    (a, first_value, first_digits), (b, second_value, second_digits) = _centre_words(writer, arc, False, {})
    edits.add(start, end, first_value, first_digits, letters[a : a + 1], 0)
    edits.add(end, end, second_value, second_digits, style.lead(slot) + letters[b : b + 1], 1)


def _tail(writer: Writer, rows: Rows, arc: Arc, edits: EditList) -> None:
    """A later part: a new block with both end words, the third axis where it moves, and the centre."""
    place = int(writer.program.line_end[arc.line - 1])
    index = int(np.searchsorted(writer.path.arcs.move, arc.move))
    absolute = bool(writer.program.arc_slots.absolute[index])
    order = rows.serial(arc.row)
    lead = writer.style.block_start(arc.line)
    if arc.row and rows.take_up[arc.row - 1]:
        lead += b"G2 " if writer.path.kind[arc.move] == Kind.ARC_CW else b"G3 "
    third = PLANES[arc.plane][2]
    for axis in range(3):
        if axis == third and not rows.write[arc.row, axis]:
            continue
        mantissa, decimals = _number(writer, rows, arc.row, axis)
        edits.add(place, place, mantissa, decimals, lead + b"XYZ"[axis : axis + 1], order + axis)
        lead = b" "
    for i, (axis, mantissa, decimals) in enumerate(_centre_words(writer, arc, absolute, {})):
        edits.add(place, place, mantissa, decimals, b" " + b"IJK"[axis : axis + 1], order + 3 + i)
    if _turns(arc) > 1:
        edits.add(place, place, _turns(arc), 0, b" P", order + 5)


def _number(writer: Writer, rows: Rows, row: int, axis: int) -> tuple[int, int]:
    """Mantissa and decimals of the position of an axis after a row, whether or not it changes."""
    if rows.write[row, axis] or rows.flag[row] & np.uint8(Flag.INCREMENTAL):
        return int(rows.mantissa[row, axis]), int(rows.decimals[row, axis])
    frame = writer.frame_of(int(rows.move[row]))
    decimals = writer.style.usual(axis, frame.unit_mm)
    value = (rows.emitted[row, axis] - frame.offset_mm[axis]) / frame.unit_mm
    return round(value * 10**decimals), decimals
