"""Centre words of corrected arcs: solved again from the end points as they are written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from olp.compensation.arcs import WIDE, Pieces, fit, sample_groups, sampled
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind
from olp.program.text.edits import EditList, Edits

if TYPE_CHECKING:
    from olp.compensation.rows import Rows
    from olp.compensation.statements import StatementWriter
    from olp.compensation.writer import Writer


_AXES = np.array(PLANES)


@dataclass(frozen=True, slots=True)
class Arc:
    """One part of an arc as it will be written, positions in mm."""

    row: int
    move: int
    line: int
    start: Array
    end: Array
    centre: Array
    sweep: float
    plane: int


@dataclass(frozen=True, slots=True, eq=False)
class ArcRows:
    """The same in columns."""

    row: Index
    move: Index
    line: npt.NDArray[np.int32]
    start: Array
    end: Array
    centre: Array
    sweep: Array
    plane: npt.NDArray[np.int8]

    def pick(self, which: Mask) -> ArcRows:
        return ArcRows(*(getattr(self, name)[which] for name in ArcRows.__slots__))

    def one(self, i: int) -> Arc:
        return Arc(
            int(self.row[i]), int(self.move[i]), int(self.line[i]), self.start[i], self.end[i],
            self.centre[i], float(self.sweep[i]), int(self.plane[i]),
        )  # fmt: skip


def arc_edits(writer: Writer, rows: Rows) -> list[Edits]:
    """Edits of I, J, K, R and P for the arc rows of a chunk, and whole blocks for their later parts."""
    path = writer.path
    kind = path.kind[rows.move]
    arc_row = np.flatnonzero(
        np.isin(kind, (Kind.ARC_CW, Kind.ARC_CCW))
        & ((rows.flag & np.uint8(Flag.PASS)) == 0)
        & ~writer.plan.take_up[rows.first : rows.first + len(rows.move)]
    )
    if not arc_row.size:
        return []
    solved = solve(writer, rows, arc_row)
    plain = _is_plain(writer, rows, solved)
    edits = EditList(writer.prefixes)
    for i in np.flatnonzero(~plain).tolist():
        arc = solved.one(i)
        (_head if rows.head[arc.row] else _tail)(writer, rows, arc, edits)
    return [edits.done(), *_plain_words(writer, solved.pick(plain))]


def _is_plain(writer: Writer, rows: Rows, arcs: ArcRows) -> Mask:
    """Arcs whose block keeps both its centre words, from the start: nearly all there are."""
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
    unit = writer.frames_unit[writer.path.frame[arcs.move]]
    out = []
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
            out.append(
                Edits(
                    words.number[slot[new]].astype(np.int64), words.end[slot[new]].astype(np.int64),
                    mantissa[new], decimals[new].astype(np.int8), zero, zero,
                )
            )  # fmt: skip
            writer.tally.changed_words += len(new)
    return out


def solve(writer: Writer | StatementWriter, rows: Rows, arc_row: Index) -> ArcRows:
    """Centres for rows, from the emitted end points and the bent path between them."""
    path, plan = writer.path, writer.plan
    move = rows.move[arc_row]
    arc = np.searchsorted(path.arcs.move, move)
    reach = plan.reach[rows.first + arc_row]
    before = np.maximum(arc_row - 1, 0)
    begin = np.where((rows.move[before] == move) & (arc_row > 0), plan.reach[rows.first + before], 0.0)
    pieces = Pieces(arc, begin, reach)
    start = np.where((arc_row > 0)[:, None], rows.emitted[before], rows.entry)
    end = rows.emitted[arc_row]
    plane = path.arcs.plane[arc]
    sweep = path.arcs.sweep_rad[arc] * (reach - begin)
    centre = np.zeros((len(arc_row), 3))
    kept = np.zeros(len(arc_row), bool)
    tools = path.tool_mm()
    for part, count in sample_groups(path, writer.model, writer.targets, pieces, tools, writer.tolerance_mm):
        bend = sampled(path, writer.model, writer.targets, pieces.pick(part), tools, count)
        best, _ = fit(bend, plane[part], start[part], end[part], sweep[part])
        equal = (np.abs(sweep[part]) <= WIDE) & (np.abs(bend.mismatch) < 1e-6) & ~bend.rigid
        centre[part] = _on_bisector(start[part], end[part], best, plane[part], equal)
        # an arc that is only shifted keeps its words
        shift = bend.command[:, 0] - bend.point[:, 0]
        alike = np.abs(start[part] - bend.point[:, 0] - end[part] + bend.point[:, -1]).max(axis=1) < 1e-7
        absolute = writer.program.arc_slots.absolute[arc[part]]
        kept[part] = bend.rigid & alike & (~absolute | (np.abs(shift).max(axis=1) < 1e-9))
    kept &= rows.head[arc_row] & (reach == 1.0)
    _check_sweep(start, end, centre, sweep, plane, path.line[move])
    solved = ArcRows(arc_row, move.astype(np.int64), path.line[move], start, end, centre, sweep, plane)
    return solved.pick(~kept)


def _on_bisector(start: Array, end: Array, centre: Array, plane: npt.NDArray[np.int8], short: Mask) -> Array:
    """Centres moved along their chords until both radii are equal, for arcs `short` of half a circle."""
    rows = np.arange(len(start))
    first, second = _AXES[plane][:, 0], _AXES[plane][:, 1]
    d0, d1 = end[rows, first] - start[rows, first], end[rows, second] - start[rows, second]
    length = np.hypot(d0, d1)
    long = short & (length > 0)
    safe = np.where(long, length, 1.0)
    d0, d1 = d0 / safe, d1 / safe
    away0 = centre[rows, first] - (start[rows, first] + end[rows, first]) / 2
    away1 = centre[rows, second] - (start[rows, second] + end[rows, second]) / 2
    along = np.where(long, away0 * d0 + away1 * d1, 0.0)
    out = centre.copy()
    out[rows, first] -= along * d0
    out[rows, second] -= along * d1
    return out


def _centre_words(
    writer: Writer, arc: Arc, absolute: bool, own: dict[int, int]
) -> list[tuple[int, int, int]]:
    """(axis, mantissa, decimals) of both centre words, with at least the digits of the program's `own`
    words."""
    frame = writer.frame_of(arc.move)
    out = []
    for axis in PLANES[arc.plane][:2]:
        base = frame.offset_mm[axis] if absolute else arc.start[axis]
        decimals = max(writer.style.centre(axis, frame.unit_mm), own.get(axis, 0))
        mantissa = round((arc.centre[axis] - base) / frame.unit_mm * 10**decimals)
        out.append((axis, mantissa, decimals))
    return out


def _check_sweep(
    start: Array,
    end: Array,
    centre: Array,
    sweep: Array,
    plane: npt.NDArray[np.int8],
    line: npt.NDArray[np.int32],
) -> None:
    """A tiny arc must not turn into a whole circle, nor the other way round, by rounding."""
    rows = np.arange(len(start))
    first, second = _AXES[plane][:, 0], _AXES[plane][:, 1]
    a0 = np.arctan2(start[rows, second] - centre[rows, second], start[rows, first] - centre[rows, first])
    a1 = np.arctan2(end[rows, second] - centre[rows, second], end[rows, first] - centre[rows, first])
    turn = np.where(sweep > 0, a1 - a0, a0 - a1) % (2 * np.pi)
    turn[turn < 1e-9] = 2 * np.pi
    off = np.abs(np.abs(sweep) - turn)
    off = np.abs(off - 2 * np.pi * np.rint(off / (2 * np.pi)))
    whole = np.abs(sweep) > np.pi
    flipped = (np.abs(sweep) < 2 * np.pi + 1e-9) & (whole != (turn > np.pi)) & (off < 0.5)
    bad = np.flatnonzero((off > 1.0) | (flipped & (np.minimum(np.abs(sweep), turn) < 0.1)))
    if bad.size:
        raise ProgramError(
            "an arc is so short that the last digit decides whether it is a whole circle; let the machine "
            "take more digits (least_increment_mm), or write this arc as a line",
            line=int(line[bad[0]]),
        )


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
    """R of the corrected arc; where R cannot say it well (near half circles), I, J, K in its place."""
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
    """A later part: a block of its own with both end points, the third axis where it moves, and the
    centre."""
    place = int(writer.program.line_end[arc.line - 1])
    index = int(np.searchsorted(writer.path.arcs.move, arc.move))
    absolute = bool(writer.program.arc_slots.absolute[index])
    order = rows.serial(arc.row)
    lead = writer.block_start(arc.line)
    if arc.row and writer.plan.take_up[rows.first + arc.row - 1]:
        lead += b"G2 " if writer.path.kind[arc.move] == Kind.ARC_CW else b"G3 "
    third = PLANES[arc.plane][2]
    for axis in range(3):
        if axis == third and not rows.write[arc.row, axis]:
            continue
        mantissa, decimals = rows.number(writer, arc.row, axis)
        edits.add(place, place, mantissa, decimals, lead + b"XYZ"[axis : axis + 1], order + axis)
        lead = b" "
    for i, (axis, mantissa, decimals) in enumerate(_centre_words(writer, arc, absolute, {})):
        edits.add(place, place, mantissa, decimals, b" " + b"IJK"[axis : axis + 1], order + 3 + i)
    if _turns(arc) > 1:
        edits.add(place, place, _turns(arc), 0, b" P", order + 5)
