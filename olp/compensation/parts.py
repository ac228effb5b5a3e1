"""The rows of a plan that go along a contour, as lines and arcs of the tool in the plane of the contour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.compensation.arcs import Pieces, fit, sample_groups, sampled
from olp.compensation.plan import Limits, Plan, targets
from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import arc_points
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.contours.elements import AXES, Elements, direction, wrapped
from olp.program.contours.meeting import Carriers

#: mm; the direction of a shorter part is that of the nominal one
_SHORT_MM = 1e-3
#: rad by which errors turn a part at most; what seems to turn it more is backlash
TURNED = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """(p,) parts of elements, one a row. `row` is its index among the rows that are kept, `element` what it
    is a part of, and `head` its first part. (p, 2) in the plane: `begin` and `end` of the tool as
    commanded, its directions there in rad (`begins`, `ends`),
    `centre` of arcs, and a `guess` of the contour's point. `left` is 1 or -1, `inside` arcs have the tool on
    their inner side. (kept, 3) `beside` are axes of rows that end beside the contour. `unit` is that of the
    program, mm."""

    row: Index
    element: Index
    head: Mask
    plane: npt.NDArray[np.int8]
    begin: Array
    end: Array
    begins: Array
    ends: Array
    arc: Mask
    inside: Mask
    centre: Array
    sweep: Array
    left: Array
    radius: Array
    guess: Array
    beside: Mask
    unit: Array

    def __len__(self) -> int:
        return len(self.row)

    @staticmethod
    def of(
        path: Toolpath, rows: Plan, kept: Index, contour: Toolpath, move: npt.NDArray[np.int32],
        elements: Elements, model: ErrorModel, limits: Limits,
    ) -> tuple[Parts, Parts]:  # fmt: skip
        """The parts among the rows `kept` of a plan for a tool's path, as nominal and as commanded; `move`
        (kept,) are their moves in the programmed path `contour`."""
        at = np.minimum(np.searchsorted(elements.move, move), len(elements) - 1)
        row = np.flatnonzero((elements.move[at] == move) & ~rows.take_up[kept])
        element, every = at[row], kept[row]
        tool_move = rows.move[every].astype(np.int64)
        plane, arc = elements.plane[element], elements.arc[element]
        head = np.concatenate(([True], element[1:] != element[:-1]))
        since = np.where(head, 0.0, np.concatenate(([0.0], rows.reach[every][:-1])))
        nominal = [_at(path, tool_move, share) for share in (since, rows.reach[every])]
        before = np.where(
            (every > 0)[:, None], rows.command_mm[np.maximum(every - 1, 0)], nominal[0]
        )  # fmt: skip
        pick = (np.arange(len(row))[:, None], AXES[plane][:, :2])
        begin, end = before[pick], rows.command_mm[every][pick]
        was, ought = nominal[0][pick], nominal[1][pick]
        angle = _turned(end - begin, ought - was)
        centre, tool_sweep = np.zeros((len(row), 2)), np.zeros(len(row))
        some = np.flatnonzero(arc)
        if some.size:
            of = np.searchsorted(path.arcs.move, tool_move[some])
            shares = Pieces(of, since[some], rows.reach[every[some]])
            found = _centres(path, rows, shares, before[some], rows.command_mm[every[some]], model, limits)
            centre[some] = found[pick[0][: len(some)], AXES[plane[some]][:, :2]]
            tool_sweep[some] = path.arcs.sweep_rad[shares.arc] * (shares.end - shares.begin)
        quarter = np.copysign(np.pi / 2, elements.sweep[element])
        begins = np.where(arc, _angle(begin - centre) + quarter, elements.begins[element] + angle)
        ends = np.where(arc, _angle(end - centre) + quarter, elements.ends[element] + angle)
        last = np.append(head[1:], True)
        own = np.where(last[:, None], elements.end[element], ought - _normals(elements, element, ends))
        # moves along the tool axis keep beside it, and so do those behind it on some controls
        tool_end, end_mm = path.end_mm[rows.move[kept]], contour.end_mm[move]
        # an axis that no block has commanded yet is in the same place in both
        beside = (tool_end != end_mm) & ~np.isnan(end_mm)
        # both axes of the plane, also where one of them happens to be the same
        off = np.flatnonzero(beside.any(axis=1))
        before = np.maximum(np.searchsorted(row, off, "right") - 1, 0)
        beside[off[:, None], AXES[plane[before]][:, :2]] = True
        beside[row[:, None], AXES[plane][:, :2]] = True
        stated = Parts(
            row, element, head, plane, was, ought, *_tangents(elements, element, was, ought), arc,
            elements.inside[element], elements.centre[element], tool_sweep, elements.side[element],
            elements.radius[element], own, beside, elements.unit[element],
        )  # fmt: skip
        return stated, replace(
            stated, begin=begin, end=end, begins=begins, ends=ends, centre=centre, guess=own + (end - ought)
        )

    def normal(self, angle: Array) -> Array:
        """(p, 2) vectors of the length of the radius towards the tool, across directions."""
        return direction(angle + self.left * np.pi / 2) * self.radius[:, None]

    def carriers(self, which: Index, *, ends: bool) -> Carriers:
        """What the contour along parts lies on, as the tool has it at their `ends` or begins."""
        point, angle = (self.end, self.ends) if ends else (self.begin, self.begins)
        arms = point[which] - self.centre[which]
        size = np.hypot(*arms.T) + np.where(self.inside, self.radius, -self.radius)[which]
        return Carriers(
            self.arc[which], (point - self.normal(angle))[which], direction(angle[which]),
            self.centre[which], size,
        )  # fmt: skip

    def made(self, begin: Array, end: Array, first: Mask) -> Elements:
        """The elements of the contour between points (p, 2); `first` parts enter it."""
        angle, quarter = _angle(end - begin), np.copysign(np.pi / 2, self.sweep)
        arms, sweep = end - self.centre, self.sweep.copy()
        for sign, tool, own in ((-1.0, self.begin, begin), (1.0, self.end, end)):
            sweep += sign * wrapped(_angle(own - self.centre) - _angle(tool - self.centre))
        return Elements(
            np.arange(len(self)), first, ~first, self.left, self.radius, self.plane, begin, end,
            np.where(self.arc, _angle(begin - self.centre) + quarter, angle),
            np.where(self.arc, _angle(arms) + quarter, angle), self.arc, self.centre, sweep,
            np.hypot(*arms.T), self.unit,
        )  # fmt: skip


def _angle(vector: Array) -> Array:
    return np.asarray(np.arctan2(vector[:, 1], vector[:, 0]))


def _tangents(elements: Elements, element: Index, begin: Array, end: Array) -> tuple[Array, Array]:
    """(p,) nominal directions of the contour at both ends of parts."""
    arc, centre = elements.arc[element], elements.centre[element]
    quarter = np.copysign(np.pi / 2, elements.sweep[element])
    return (
        np.where(arc, _angle(begin - centre) + quarter, elements.begins[element]),
        np.where(arc, _angle(end - centre) + quarter, elements.ends[element]),
    )


def _turned(now: Array, nominal: Array) -> Array:
    """(p,) rad by which parts are turned, 0 where that is not known."""
    angle = wrapped(_angle(now) - _angle(nominal))
    known = (np.hypot(*nominal.T) > _SHORT_MM) & (np.abs(angle) < TURNED)
    return np.where(known, angle, 0.0)


def _normals(elements: Elements, element: Index, angle: Array) -> Array:
    radius = elements.radius[element][:, None]
    return direction(angle + elements.side[element] * np.pi / 2) * radius


def _at(path: Toolpath, move: Index, share: Array) -> Array:
    """(p, 3) nominal points at shares of moves."""
    start = np.where((move > 0)[:, None], path.end_mm[np.maximum(move - 1, 0)], np.array(path.start_mm))
    end = path.end_mm[move]
    point = start + share[:, None] * (end - start)
    point[share == 1.0] = end[share == 1.0]
    arc = np.minimum(np.searchsorted(path.arcs.move, move), max(len(path.arcs) - 1, 0))
    if len(path.arcs):
        mine = np.flatnonzero(path.arcs.move[arc] == move)
        of, arcs = arc[mine], path.arcs
        point[mine] = arc_points(
            start[mine], end[mine], arcs.centre_mm[of], arcs.plane[of], arcs.sweep_rad[of], share[mine]
        )
    return point


def _centres(
    path: Toolpath, rows: Plan, pieces: Pieces, start: Array, end: Array, model: ErrorModel, limits: Limits
) -> Array:
    """(a, 3) centres of the arcs between commands that lie best on the bent path."""
    tools, target = path.tool_mm(), targets(path, rows.shift_mm)
    plane = path.arcs.plane[pieces.arc]
    sweep = path.arcs.sweep_rad[pieces.arc] * (pieces.end - pieces.begin)
    centre = np.zeros((len(pieces), 3))
    for part, count in sample_groups(path, model, target, pieces, tools, limits.tolerance_mm):
        bend = sampled(path, model, target, pieces.pick(part), tools, count)
        begin = np.where(np.isfinite(start[part]), start[part], bend.command[:, 0])
        centre[part] = fit(bend, plane[part], begin, end[part], sweep[part])
    return centre
