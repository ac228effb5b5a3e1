"""From a plan of the tool's path to the contour that makes the control move there.

The plan says where the tool is commanded. Each of its moves is a line or an arc beside the contour. So the
contour's line or arc lies at the distance of the cutter radius from it, and the contour's corners are where
these meet. Nothing is iterated but the direction of entries, which depends on their own ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.parts import TURNED, Parts
from olp.compensation.plan import Limits, Plan
from olp.compensation.short_blocks import Grid, together
from olp.compensation.style import Style
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ProgramError
from olp.errormodel.base import ErrorModel
from olp.program.bands import Band
from olp.program.contours.elements import AXES, Elements, direction, wrapped
from olp.program.contours.entries import centre_on
from olp.program.contours.joints import Corner, corners, joints, refuse
from olp.program.contours.meeting import meeting
from olp.program.program import Program

#: passes for the direction of entries
_PASSES = 4
#: share of its length by which a turned line may become longer or shorter
_LONGER = 0.25


def programmed(band: Band, rows: Plan, model: ErrorModel, limits: Limits, style: Style) -> tuple[Band, Plan]:
    """A band whose path is what is programmed, and the plan for it; `style` says which numbers can be
    written. Raises ProgramError where the control would refuse the contour, or would make other moves of
    it."""
    program = band.program
    if program.programmed is None:
        return band, rows
    contour = program.programmed
    elements = Elements.of(contour.toolpath)
    if not len(elements):
        return replace(band, program=contour), rows
    every = _Contour(program, contour, elements, rows, model, limits, style)
    return replace(band, program=contour), every.plan()


class _Contour:
    """One band while its contours are found. `parts` are the rows that go along elements."""

    def __init__(
        self, program: Program, contour: Program, elements: Elements, rows: Plan, model: ErrorModel,
        limits: Limits, style: Style,
    ) -> None:  # fmt: skip
        assert program.blocks is not None
        self.rows, self.path, self.elements = rows, contour.toolpath, elements
        self.contour, self.limits, self.style = contour, limits, style
        self.rules = program.rs274.contours
        corner = np.array([(c := f.compensation) is not None and c.corner for f in program.toolpath.frames])
        move = program.blocks[rows.move]
        self.kept = np.flatnonzero(~corner[program.toolpath.frame[rows.move]])
        self.move = move[self.kept].astype(np.int32)
        self.nominal, self.parts = Parts.of(
            program.toolpath, rows, self.kept, self.path, self.move, elements, model, limits
        )  # fmt: skip

    def plan(self) -> Plan:
        """The rows of the programmed path."""
        parts, rows, kept = self.parts, self.rows, self.kept
        # what rounded words of arcs leave between the contour and the tool's path is in both
        stated = self._points(self.nominal)
        last = np.append(parts.head[1:], True)
        point = np.where(last[:, None], self.elements.end[parts.element], stated)
        point = point + self._points(parts) - stated
        self.parts = parts = self._entered(point)
        point = together(self._made(point), self._grid(), self.limits)
        made = self._made(point)
        self._check(made)
        command = rows.command_mm[kept].copy()
        raw = rows.raw[kept]
        self._put(command, point)
        command[raw] = self.path.end_mm[self.move][raw]
        centre = np.full((len(kept), 3), np.nan)
        arcs = np.flatnonzero(parts.arc)
        axes = AXES[parts.plane[arcs]]
        centre[parts.row[arcs]] = command[parts.row[arcs]]
        for i in (0, 1):
            centre[parts.row[arcs], axes[:, i]] = parts.centre[arcs, i]
        reach = rows.reach[kept].copy()
        reach[parts.row[arcs]] = self._reach(made)[arcs]
        return Plan(
            self.move, rows.target_mm[kept] if len(rows.target_mm) else rows.target_mm, command, raw, reach,
            rows.take_up[kept], rows.uncorrected, rows.shift_mm,
            None if rows.play is None else rows.play[kept], centre,
        )  # fmt: skip

    def _entered(self, point: Array) -> Parts:
        """The parts with the programmed centres of arcs that enter a contour: on the line of that of the
        tool, and as far from the begin as from the end."""
        parts, elements = self.parts, self.elements
        arcs = np.flatnonzero((elements.first & elements.arc)[parts.element])
        if not arcs.size:
            return parts
        self._refuse_backward(arcs)
        centre = parts.centre.copy()
        centre[arcs] = centre_on(point[arcs], parts.centre[arcs], parts.begin[arcs])
        return replace(parts, centre=centre)

    def _refuse_backward(self, arcs: Index) -> None:
        """Raise ProgramError where the tool arrives against the direction of an arc, part `arcs`, that enters
        a contour: there a digit of the programmed arc moves that of the tool by many."""
        parts, of = self.parts, self.parts.element[arcs]
        way, own = parts.centre[arcs] - parts.end[arcs], self.elements.centre[of] - parts.end[arcs]
        errors = [
            ProgramError(
                f"the arc into the contour brings a cutter of {self.elements.radius[i]:g} mm against its own "
                "direction; make the move longer, use a smaller cutter, or have this path of the tool "
                "written, with --contour path",
                line=int(self.path.line[self.elements.move[i]]),
                code="OLP561",
            )
            for i in of[(way * own).sum(axis=1) < 0].tolist()
        ]
        if errors:
            raise ProgramError.together(errors)

    def _grid(self) -> Grid:
        """What the ends of parts can be written as."""
        parts, move = self.parts, self.move
        changes = np.concatenate(([True], move[1:] != move[:-1], [True]))
        alone = changes[:-1] & changes[1:] & ~self.rows.raw[self.kept].any(axis=1)
        own, axes = move[parts.row].astype(np.int64), AXES[parts.plane][:, :2]
        return Grid.of(self.contour, self.style, own, axes, alone[parts.row])

    def _corner(self) -> Array:
        """(p,) the corner before each part."""
        parts = self.parts
        corner, _ = corners(self.elements, self.rules)
        return np.where(parts.head, corner[parts.element], Corner.SMOOTH)

    def _points(self, parts: Parts) -> Array:
        """(p, 2) the points of the contour at the ends of parts."""
        elements = self.elements
        begins, ends = parts.begins.copy(), parts.ends.copy()
        behind = np.append(self._corner()[1:], Corner.ENTRY)
        last = np.append(elements.first[parts.element[1:]] & parts.head[1:], True)
        behind[last] = Corner.ENTRY
        following = np.minimum(np.arange(len(parts)) + 1, len(parts) - 1)
        guess = parts.guess
        # lines that begin where another part ends, and not where two carriers meet
        enters = elements.first[parts.element] & parts.head
        smooth = np.flatnonzero((enters | (self._corner() == Corner.SMOOTH)) & ~parts.arc)
        before = np.maximum(smooth - 1, 0)
        sharp = self._sharp(smooth, guess[smooth] - guess[before]) & ~enters[smooth]
        along = direction(elements.begins[parts.element[smooth]])
        point = guess
        for _ in range(_PASSES):
            now = point[smooth] - np.where(enters[smooth, None], parts.begin[smooth], point[before])
            turn = wrapped(np.arctan2(now[:, 1], now[:, 0]) - parts.ends[smooth])
            turn[np.abs(turn) > TURNED] = 0.0
            angle = np.where(sharp, elements.begins[parts.element[smooth]], parts.ends[smooth] + turn)
            ends[smooth] = begins[smooth] = angle
            turned = replace(parts, begins=begins, ends=ends)
            point = parts.end - parts.normal(ends)
            entered = np.flatnonzero(behind == Corner.ENTERED)
            after = following[entered]
            point[entered] = parts.begin[after] - parts.normal(begins)[after]
            met = np.flatnonzero((behind == Corner.INSIDE) | (behind == Corner.OUTSIDE))
            one, other = turned.carriers(met, ends=True), turned.carriers(following[met], ends=False)
            found = meeting(one, other, guess[met])
            point[met] = np.where(np.isnan(found), guess[met], found)
            some, last = smooth[sharp], before[sharp]
            way = ((point[some] - point[last]) * along[sharp]).sum(axis=1)
            point[some] = point[last] + way[:, None] * along[sharp]
        return np.asarray(point)

    def _sharp(self, row: Index, way: Array) -> Mask:
        """(k,) lines, parts `row`, that a step aside would turn so far that the tool goes much farther or
        less far: they keep their directions, and the tool stays aside along them. `way` (k, 2) they go."""
        parts, own = self.parts, self.elements.begins[self.parts.element[row]]
        turn = np.abs(wrapped(np.arctan2(way[:, 1], way[:, 0]) - own))
        return np.asarray(parts.radius[row] * turn > _LONGER * np.hypot(*way.T))

    def _put(self, command: Array, point: Array) -> None:
        """Put the points into commands, where rows end beside the contour."""
        parts = self.parts
        last = np.searchsorted(parts.row, np.arange(len(command)), "right") - 1
        for k in range(3):
            off = parts.beside[:, k] & (last >= 0)
            of = last[off]
            axes = AXES[parts.plane[of]]
            value = np.where(axes[:, 0] == k, point[of, 0], point[of, 1])
            in_plane = (axes[:, 0] == k) | (axes[:, 1] == k)
            command[np.flatnonzero(off)[in_plane], k] = value[in_plane]

    def _made(self, point: Array) -> Elements:
        """The contour as it will be programmed, its parts being elements."""
        parts = self.parts
        before = np.maximum(np.arange(len(parts)) - 1, 0)
        first = self.elements.first[parts.element] & parts.head
        return parts.made(np.where(first[:, None], parts.begin, point[before]), point, first)

    def _reach(self, made: Elements) -> Array:
        """(p,) the share of the programmed arc where each part of one ends."""
        parts = self.parts
        gone = np.cumsum(made.sweep)
        heads = np.flatnonzero(parts.head)
        which = np.cumsum(parts.head) - 1
        before = (gone - made.sweep)[heads][which]
        whole = np.append(gone[heads[1:] - 1], gone[-1])[which] - before
        last = np.append(parts.head[1:], True)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(last, 1.0, (gone - before) / whole)

    def _check(self, made: Elements) -> None:
        """Raise ProgramError where the control would refuse this contour, or round off another corner."""
        parts, elements, rules = self.parts, self.elements, self.rules
        line = self.path.line[elements.move[parts.element]]
        now, _ = corners(made, rules)
        lost = (self._corner() == Corner.OUTSIDE) & (now != Corner.OUTSIDE)
        way = "; have the path of the tool written instead, with --contour path"
        if lost.any():
            raise ProgramError(
                "corrected, the outside corner before this move is none any more for the control" + way,
                line=int(line[np.argmax(lost)]),
                code="OLP561",
            )
        try:
            refuse(made, joints(made, rules), rules, line)
        except ProgramError as error:
            raise ProgramError(
                f"the control would refuse this block once corrected, and uncorrected it only just takes it: "
                f"{error.message.partition(';')[0]}{way}",
                line=error.line,
                code="OLP561",
            ) from None
