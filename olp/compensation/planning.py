"""Where every move of a program has to be commanded so that the tip follows the nominal path.

A `Planning` inverts the error model at the waypoints, subdivides what would bend (`lines`, `arcs`), and
follows the play of axes with backlash (`reversal`), band by band. The result knows nothing of text.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.compensation.approach import Known, with_approaches
from olp.compensation.arcs import subdivide_arcs
from olp.compensation.contour import Contour, in_arcs, long_parts
from olp.compensation.invert import invert
from olp.compensation.lines import Cuts, subdivide_lines
from olp.compensation.plan import Limits, Plan, targets, zero_shifts
from olp.compensation.reversal import Carried, Reversal, carry_play
from olp.compensation.style import Style
from olp.core.arrays import Array, Index, Mask, all_in_row, any_in_row, distinct, is_in
from olp.core.errors import OutsideBox, ProgramError
from olp.core.machine import Vector
from olp.core.progress import Progress, part, silent
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import MM_PER_INCH
from olp.errormodel.base import ErrorModel
from olp.program.bands import Band, bands
from olp.program.program import Program

#: share of the tolerance that chords may use; the search's own steps need the other 5 %
CHORD_SHARE = 0.95
#: an arc through rounded ends with a rounded centre strays by about this much more of the last digit than
#: a line
ARC_DIGIT_SHARE = 0.6
#: share of the tolerance by which an axis with backlash may lag instead of turning round
DEAD_BAND_SHARE = 0.25
#: moves that are left as they are
_UNTOUCHED = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)
#: moves that are never split, beside those that are left as they are
_UNSPLIT = np.uint8(Flag.CYCLE | Flag.WHOLE)


def plans(
    program: Program, model: ErrorModel, limits: Limits, tell: Progress = silent
) -> Iterator[tuple[Band, Plan]]:
    """The bands of a program with the plan of each. `tell` is told the first half of each band; the other is
    that of who takes it. Raises as `Planning.rows`."""
    planning = Planning(model, limits)
    for band in bands(program):
        told = part(tell, band.share, band.middle)
        yield band, planning.rows(band.program.toolpath, band.ahead_mm, told)


def written_plans(
    program: Program, model: ErrorModel, limits: Limits, increments_mm: Vector, tell: Progress = silent
) -> Iterator[tuple[Band, Plan]]:
    """As `plans`, of what is programmed: contours where there is cutter compensation. `increments_mm` are the
    least ones of the axes. Raises as `plans`, and ProgramError where the control would refuse a contour."""
    every = plans(program, model, limits, tell)
    if program.programmed is None:
        yield from every
        return
    from olp.compensation.programmed import programmed

    style = Style.of(program.programmed, increments_mm)
    for band, rows in every:
        yield programmed(band, rows, model, limits, style)


def uncorrected_moves(program: Program, model: ErrorModel, limits: Limits) -> Index:
    """The moves of a program that are left uncorrected for want of a position. Raises as
    `Planning.rows`."""
    parts = [band.first + rows.uncorrected for band, rows in plans(program, model, limits)]
    return np.concatenate(parts)


def plan(path: Toolpath, model: ErrorModel, limits: Limits) -> Plan:
    """Commands for a whole path. Raises as `Planning.rows`."""
    return Planning(model, limits).rows(path, np.zeros((0, 3)))


class Planning:
    """Plans a path band by band; what is known of the play of the axes goes on from each to the next."""

    def __init__(self, model: ErrorModel, limits: Limits) -> None:
        self.model, self.limits = model, limits
        self.reversal = Reversal.of(model, limits.tolerance_mm * DEAD_BAND_SHARE)
        self._known, self._carried = Known(), Carried()
        #: (3,) where the tip has to be at the end of the last band, None before the first one
        self._target: Array | None = None

    def rows(self, path: Toolpath, ahead_mm: Array, tell: Progress = silent) -> Plan:
        """Commands for the next band, behind which moves end at `ahead_mm` (k, 3). Raises ProgramError for a
        feed move whose error cannot be known, OutsideBox, NotInvertible."""
        model, limits, reversal = self.model, self.limits, self.reversal
        shift = zero_shifts(path.frames, model) if path.frames else np.zeros((0, 3))
        target = targets(path, shift)
        begin = np.array(path.start_mm) if self._target is None else self._target
        raw, uncorrected = _untouched(path, model)
        command = _waypoints(path, model, target, raw)
        tell("correct", 0.3)
        chord = limits.tolerance_mm * (CHORD_SHARE - (DEAD_BAND_SHARE if reversal is not None else 0.0))
        contour = Contour.of(path)
        whole = ((path.flag & _UNSPLIT) != 0) | any_in_row(raw)
        if contour is not None:
            whole |= contour.whole
        kinds = (Kind.LINE, Kind.RAPID) if limits.split_rapids else (Kind.LINE,)
        free = ~whole
        # behind a `/` block the start depends on the switch, so no cut can be right for both
        free[1:] &= ~(((path.flag[:-1] & ~path.flag[1:]) & np.uint8(Flag.DELETED)) != 0)
        lines = free & is_in(path.kind, kinds)
        cuts_line = subdivide_lines(path, model, begin, target, lines, chord)
        tell("correct", 0.5)
        chord_arc = max(chord - ARC_DIGIT_SHARE * limits.digit_mm, 0.3 * limits.tolerance_mm)
        turning, band = (None, 0.0) if reversal is None else (reversal.axes, reversal.band_mm)
        cuts_arc = subdivide_arcs(
            path, model, target, ~whole, chord_arc, turning, band, limits.digit_mm, limits.one_radius
        )
        tell("correct", 0.7)
        cuts = [cuts_line, cuts_arc]
        if contour is not None:
            cuts = [long_parts(path, cuts_line), in_arcs(path, model, cuts_arc, contour.whole)]
        rows = _expand(path, target, command, raw, uncorrected, shift, cuts, model, reversal is not None)
        if contour is not None:
            rows = contour.hold(rows)
        if reversal is not None:
            rows = self._with_play(path, rows, reversal, contour, free, ahead_mm, part(tell, 0.7, 1.0))
        if limits.refuse_outside:
            _check_box(path, model, rows)
        if len(path):
            self._target = target[-1].copy()
        return rows

    def _with_play(
        self, path: Toolpath, rows: Plan, reversal: Reversal, contour: Contour | None, free: Mask,
        ahead_mm: Array, tell: Progress,
    ) -> Plan:  # fmt: skip
        """The plan of a band with the rows that take up backlash."""
        limits, steady = self.limits, None if contour is None else contour.steady
        rows = with_approaches(
            path, self.model, rows, reversal.axes, limits, steady, self._known, ahead_mm
        )  # fmt: skip
        tell("correct", 0.3)
        return carry_play(
            path, self.model, rows, reversal, contour, self._carried, free=free, limits=limits,
            tell=part(tell, 0.3, 1.0),
        )  # fmt: skip


def _untouched(path: Toolpath, model: ErrorModel) -> tuple[Mask, Index]:
    """(n, 3) axes that keep the program's words, and the moves left uncorrected because an axis is
    unknown."""
    raw = np.zeros((len(path), 3), bool)
    raw[(path.flag & _UNTOUCHED) != 0] = True
    unknown = np.isnan(path.end_mm)
    uncorrected = np.zeros(0, np.int64)
    some = np.flatnonzero(any_in_row(unknown))
    if some.size:
        blind = np.any(unknown[some][:, None, :] & model.depends_on[None], axis=2)
        # an unknown axis that has an error would need a word, which it never gets
        tool = path.tool_mm()
        error = model.error(path.end_mm[some], tool if tool.ndim == 1 else tool[some])
        lacking = any_in_row(unknown[some] & (np.nan_to_num(error) != 0))
        wanting = some[(any_in_row(blind) | lacking) & ~any_in_row(raw[some])]
        cutting = wanting[path.kind[wanting] != Kind.RAPID]
        if cutting.size:
            i = int(cutting[0])
            axes = " and ".join("XYZ"[a] for a in np.flatnonzero(unknown[i]))
            raise ProgramError(
                f"the position of {axes} is not known at this feed move, and its correction needs it; "
                "command all axes in an absolute rapid first, or give a machine file and a job file with "
                f"start_mm{_lost(path, i)}",
                line=int(path.line[i]),
                code="OLP524",
            )
        raw[some] |= blind | unknown[some]
        uncorrected = wanting
    held = _hold_after_machine_moves(path, raw)
    _mix_turned(path, raw)
    return raw, distinct(np.concatenate((uncorrected, held)))


def _lost(path: Toolpath, move: int) -> str:
    """Where the control has moved the axes by itself, so that the position is not known at a move."""
    axes = np.isnan(path.end_mm[move])
    own = np.isnan(path.end_mm[:move]) & ((path.flag[:move] & np.uint8(Flag.CONTROL)) != 0)[:, None]
    lost = np.flatnonzero(any_in_row(own[:, axes]))
    if not lost.size:
        return ""
    return (
        f". The control moves by itself in line {path.line[lost[-1]]}: where it leaves the axes of a tool "
        "change, G28 or G30 can be stated in the machine file (tool_change_moves, tool_change_mm, home_mm)"
    )


def _mix_turned(path: Toolpath, raw: Mask) -> None:
    """In a turned frame one word moves several axes: where one of these keeps the program's words, all do."""
    turns = path.turns()
    some = np.flatnonzero(any_in_row(raw) & ~all_in_row(raw))
    if turns is not None and some.size:
        mixes = turns.mixes(turns.of_frame[path.frame[some]])
        words = np.any(mixes & raw[some][:, :, None], axis=1)
        raw[some] = np.any(mixes & words[:, None, :], axis=2)


def _hold_after_machine_moves(path: Toolpath, raw: Mask) -> Index:
    """An axis that G53 sent to a machine position is held there in the rapids that follow without a word for
    it: a word inserted there could drive it against its limit switch. Returns those rapids."""
    held = []
    machine = np.flatnonzero(path.flag & np.uint8(Flag.MACHINE))
    for i in machine.tolist():
        before = path.end_mm[i - 1] if i else np.array(path.start_mm)
        for axis in np.flatnonzero(~(path.end_mm[i] == before)).tolist():
            j = i + 1
            while (
                j < len(path) and path.kind[j] == Kind.RAPID and path.end_mm[j, axis] == path.end_mm[i, axis]
            ):
                raw[j, axis] = True
                held.append(j)
                j += 1
    return np.array(sorted(set(held)), np.int64)


def _waypoints(path: Toolpath, model: ErrorModel, target: Array, raw: Mask) -> Array:
    command = invert(model, target, path.tool_mm())
    if raw.any():
        command[raw] = path.end_mm[raw]
    return command


def _expand(
    path: Toolpath,
    target: Array,
    command: Array,
    raw: Mask,
    uncorrected: Index,
    shift: Array,
    cuts: list[Cuts],
    model: ErrorModel,
    keep_target: bool,
) -> Plan:
    """Rows of all moves with the cuts (move, share of the move, target there) before their ends."""
    count = len(path)
    none = np.zeros((0, 3))
    where = np.concatenate([c[0] for c in cuts])
    if not len(where):
        return Plan(
            np.arange(count, dtype=np.int32), target if keep_target else none, command, raw, np.ones(count),
            np.zeros(count, bool), uncorrected, shift, None,
        )  # fmt: skip
    share = np.concatenate([c[1] for c in cuts])
    point = np.concatenate([c[2] for c in cuts])
    order = np.lexsort((share, where))
    where, share, point = where[order], share[order], point[order]
    parts = np.bincount(where, minlength=count) + 1
    move = np.repeat(np.arange(count, dtype=np.int32), parts)
    last = np.cumsum(parts) - 1
    is_cut = np.ones(len(move), bool)
    is_cut[last] = False
    tool = path.tool_mm()
    cut_command = invert(model, point, tool if tool.ndim == 1 else tool[where])
    out_target = none
    if keep_target:
        out_target = np.zeros((len(move), 3))
        out_target[last], out_target[is_cut] = target, point
    out_command = np.zeros((len(move), 3))
    out_command[last], out_command[is_cut] = command, cut_command
    reach = np.ones(len(move))
    reach[is_cut] = share
    return Plan(
        move, out_target, out_command, raw[move], reach, np.zeros(len(move), bool), uncorrected, shift, None
    )


def _check_box(path: Toolpath, model: ErrorModel, rows: Plan) -> None:
    """Every corrected command has to lie in the calibrated box; arcs between their ends too."""
    box = model.box_mm
    with np.errstate(invalid="ignore"):
        outside = (rows.command_mm < box[:, 0]) | (rows.command_mm > box[:, 1])
    outside &= ~((path.flag & _UNTOUCHED) != 0)[rows.move][:, None]
    if outside.any():
        row = int(np.flatnonzero(any_in_row(outside))[0])
        axis = int(np.flatnonzero(outside[row])[0])
        unit = path.frames[int(path.frame[rows.move[row]])].unit_mm
        inches = "; the program counts in inches there" if unit == MM_PER_INCH else ""
        raise OutsideBox(
            f"axis {'XYZ'[axis]} would be commanded to {rows.command_mm[row, axis]:.3f} mm, outside the "
            f"calibrated box {box[axis, 0]:g} to {box[axis, 1]:g} mm; move the part, calibrate there, or "
            f"accept the error at the box face with --outside-box hold{inches}",
            line=int(path.line[rows.move[row]]),
        )
