"""Arcs as they are written: their centres, solved again from the end points after rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.compensation.arcs import WIDE, Bend, Pieces, fit, sample_groups, sampled
from olp.compensation.rows import Rows
from olp.compensation.writer import Writer
from olp.core.arrays import Array, Index, Mask, most_in_row
from olp.core.errors import ProgramError
from olp.core.geometry import arms, in_planes, put_in_planes
from olp.core.toolpath import Flag
from olp.core.values import dataclass


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
    """Parts of arcs in columns."""

    row: Index
    move: Index
    line: npt.NDArray[np.int32]
    start: Array
    end: Array
    centre: Array
    sweep: Array
    plane: npt.NDArray[np.int8]

    def pick(self, which: Mask | Index) -> ArcRows:
        return ArcRows(*(getattr(self, name)[which] for name in ArcRows.__slots__))

    def one(self, i: int) -> Arc:
        return Arc(
            int(self.row[i]), int(self.move[i]), int(self.line[i]), self.start[i], self.end[i],
            self.centre[i], float(self.sweep[i]), int(self.plane[i]),
        )  # fmt: skip


def solve(writer: Writer, rows: Rows, by_angle: Mask | None = None) -> ArcRows:
    """The corrected arcs among rows, with their centres from the emitted end points and the bent path between
    them. Where the sagitta is less than the rounding of the ends, the path between does not tell the centre,
    and the arc keeps its radius. Raises ProgramError where the last digit decides whether an arc is a whole
    circle, which it does not in the rows (r,) `by_angle`, whose blocks state how far they turn."""
    path, plan = writer.path, writer.plan
    arc_row = np.flatnonzero(rows.arc & ~rows.take_up & ((rows.flag & np.uint8(Flag.PASS)) == 0))
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
    given = _given(writer, rows, arc_row)
    free = np.flatnonzero(np.isnan(given[:, 0]))
    told = np.flatnonzero(~np.isnan(given[:, 0]))
    centre[told], kept[told] = _told(writer, arc[told], start[told], end[told], given[told], sweep[told])
    groups = sample_groups(
        path, writer.model, writer.targets, pieces.pick(free), tools, writer.tolerance_mm
    )  # fmt: skip
    for group, count in groups:
        part = free[group]
        bend = sampled(path, writer.model, writer.targets, pieces.pick(part), tools, count)
        best = fit(bend, plane[part], start[part], end[part], sweep[part], by_angle is not None)
        equal = (np.abs(sweep[part]) <= WIDE) & (np.abs(bend.mismatch) < 1e-6) & ~bend.rigid
        centre[part] = _on_bisector(start[part], end[part], best, plane[part], equal)
        flat = _flat(bend, start[part], end[part], sweep[part], plane[part])
        flat |= _turned(start[part], end[part], centre[part], sweep[part], plane[part])
        small = np.flatnonzero(flat & ~bend.rigid & (np.abs(sweep[part]) <= WIDE))
        if small.size:
            which = part[small]
            radius = _radius(_picked(bend, small), plane[which], sweep[which], by_angle is not None)
            _set_radius(centre, which, start, end, sweep, plane, radius)
        # an arc that is only shifted keeps its words
        shift = bend.command[:, 0] - bend.point[:, 0]
        alike = most_in_row(np.abs(start[part] - bend.point[:, 0] - end[part] + bend.point[:, -1])) < 1e-7
        absolute = writer.program.arc_slots.absolute[arc[part]]
        kept[part] = bend.rigid & alike & (~absolute | (most_in_row(np.abs(shift)) < 1e-9))
    kept &= rows.head[arc_row] & (reach == 1.0)
    solved = ArcRows(arc_row, move.astype(np.int64), path.line[move], start, end, centre, sweep, plane)
    _check_sweep(solved if by_angle is None else solved.pick(~by_angle[arc_row]))
    return solved.pick(~kept)


def _given(writer: Writer, rows: Rows, arc_row: Index) -> Array:
    """(m, 3) the centres that the plan states, NaN where it states none."""
    stated = writer.plan.centre_mm
    return np.full((len(arc_row), 3), np.nan) if stated is None else stated[rows.first + arc_row]


def _told(
    writer: Writer, arc: Index, start: Array, end: Array, given: Array, sweep: Array
) -> tuple[Array, Mask]:
    """Centres that the plan states, between ends as written; and arcs that are only shifted."""
    path, arcs = writer.path, writer.path.arcs
    move, plane = arcs.move[arc], arcs.plane[arc]
    first = np.where((move > 0)[:, None], path.end_mm[np.maximum(move - 1, 0)], np.array(path.start_mm))
    last = path.end_mm[move]
    radii = [np.hypot(*arms(point, arcs.centre_mm[arc], plane)) for point in (first, last)]
    equal = (np.abs(sweep) <= WIDE) & (np.abs(radii[1] - radii[0]) < 1e-6)
    shift = start - first
    off = np.maximum(
        np.abs(end - last - shift).max(axis=1, initial=0.0),
        np.hypot(*arms(given - arcs.centre_mm[arc] - shift, np.zeros_like(given), plane)),
    )
    alike = off < 1e-7
    absolute = writer.program.arc_slots.absolute[arc]
    kept = alike & (~absolute | (np.abs(shift).max(axis=1, initial=0.0) < 1e-9))
    return _on_bisector(start, end, given, plane, equal & ~alike), kept


def _on_bisector(start: Array, end: Array, centre: Array, plane: npt.NDArray[np.int8], short: Mask) -> Array:
    """Centres moved along their chords until both radii are equal, for arcs `short` of half a circle."""
    (s0, s1, _), (e0, e1, _), (c0, c1, _) = (in_planes(some, plane) for some in (start, end, centre))
    d0, d1 = e0 - s0, e1 - s1
    length = np.hypot(d0, d1)
    long = short & (length > 0)
    safe = np.where(long, length, 1.0)
    d0, d1 = d0 / safe, d1 / safe
    along = np.where(long, (c0 - (s0 + e0) / 2) * d0 + (c1 - (s1 + e1) / 2) * d1, 0.0)
    moved = centre.copy()
    put_in_planes(moved, plane, c0 - along * d0, c1 - along * d1)
    return moved


def _flat(bend: Bend, start: Array, end: Array, sweep: Array, plane: npt.NDArray[np.int8]) -> Mask:
    """(n,) whether arcs rise above their chords by less than their ends were rounded."""
    rounded = [np.hypot(*arms(written, bend.command[:, k], plane)) for written, k in ((start, 0), (end, -1))]
    radius = np.hypot(*arms(bend.command[:, 0], bend.centre, plane))
    return np.asarray(radius * (1.0 - np.cos(sweep / 2)) < np.maximum(*rounded), bool)


def _picked(bend: Bend, which: Index) -> Bend:
    """Some of the pieces of a sampling."""
    names = ("point", "command", "centre", "mismatch", "rigid")
    return replace(bend, **{name: getattr(bend, name)[which] for name in names})


def _radius(bend: Bend, plane: npt.NDArray[np.int8], sweep: Array, one_radius: bool) -> Array:
    """(n,) the radii of pieces of arcs between their ends before rounding."""
    start, end = bend.command[:, 0], bend.command[:, -1]
    return np.hypot(*arms(start, fit(bend, plane, start, end, sweep, one_radius), plane))


def _set_radius(
    centre: Array, which: Index, start: Array, end: Array, sweep: Array,
    plane: npt.NDArray[np.int8], radius: Array,
) -> None:  # fmt: skip
    """Set the centres (m, 3) of arcs up to half a circle, `which` of all, by a `radius` (n,) each."""
    (s0, s1, _), (e0, e1, _) = (in_planes(some[which], plane[which]) for some in (start, end))
    half0, half1 = (e0 - s0) / 2, (e1 - s1) / 2
    half = np.hypot(half0, half1)
    away = np.sqrt(np.maximum(radius * radius - half * half, 0.0)) * np.sign(sweep[which])
    away = np.divide(away, half, out=np.zeros_like(half), where=half > 0)
    moved = centre[which]
    put_in_planes(moved, plane[which], s0 + half0 - away * half1, s1 + half1 + away * half0)
    centre[which] = moved


def _turned(start: Array, end: Array, centre: Array, sweep: Array, plane: npt.NDArray[np.int8]) -> Mask:
    """(n,) where arcs between rounded ends are tiny, and were whole circles, or the other way round."""
    (x0, y0), (x1, y1) = (arms(point, centre, plane) for point in (start, end))
    a0, a1 = np.arctan2(y0, x0), np.arctan2(y1, x1)
    turn = np.where(sweep > 0, a1 - a0, a0 - a1) % (2 * np.pi)
    turn[turn < 1e-9] = 2 * np.pi
    off = np.abs(np.abs(sweep) - turn)
    off = np.abs(off - 2 * np.pi * np.rint(off / (2 * np.pi)))
    whole = np.abs(sweep) > np.pi
    flipped = (np.abs(sweep) < 2 * np.pi + 1e-9) & (whole != (turn > np.pi)) & (off < 0.5)
    return np.asarray((off > 1.0) | (flipped & (np.minimum(np.abs(sweep), turn) < 0.1)), bool)


def _check_sweep(arcs: ArcRows) -> None:
    """Raise ProgramError where rounding makes a tiny arc a whole circle, or a whole circle a tiny arc."""
    bad = np.flatnonzero(_turned(arcs.start, arcs.end, arcs.centre, arcs.sweep, arcs.plane))
    if bad.size:
        raise ProgramError(
            "the last digit decides whether this short arc is a whole circle; state more digits "
            "(least_increment_mm) if the control takes them, or write this arc as a line",
            line=int(arcs.line[bad[0]]),
            code="OLP561",
        )
