"""Tilted planes on machines with rotary axes: the positions that the control finds, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import ConfigError, ProgramError
from olp.core.toolpath import Flag
from olp.kinematics.chain import Kinematics
from olp.kinematics.directions import rotary_positions
from olp.kinematics.structure import Structure
from olp.program.program import Program
from olp.program.tilts import Tilt

#: rad by which the tool may be off the normal of a plane: two words of two decimals, half a digit each.
_OFF_NORMAL = 1.3e-4
#: Below this sine an axis is along the normal.
_ALONG = 1e-9
#: deg below which a position counts as zero.
_ZERO_DEG = 1e-6


def found_positions(
    program: Program, structure: Structure, letters: Sequence[str], swivel_axis: str
) -> Array:
    """(n, k) positions of rotary axes that the control finds by itself, NaN elsewhere. `swivel_axis` is as in
    `JointMachine`. Raises ProgramError where the program does not say which of several it takes."""
    places = np.full((len(program.toolpath), len(letters)), np.nan)
    for tilt in program.tilts:
        values = _position(tilt, structure, swivel_axis)
        for letter in tilt.letters or letters:
            if letter not in values:
                raise ProgramError(_unknown(letter, letters), line=tilt.line, code="OLP565")
            places[tilt.move, letters.index(letter)] = values[letter]
    return places


def _unknown(letter: str, letters: Sequence[str]) -> str:
    if letter not in letters:
        return f"the block moves {letter}, which is no axis of the machine; expected {', '.join(letters)}"
    return (
        f"the plane is turned about the axis of {letter}, and whether {letter} turns with it is not known; "
        f"program the position of {letter}, or TABLE ROT in PLANE"
    )


def _position(tilt: Tilt, structure: Structure, swivel_axis: str) -> Mapping[str, float]:
    """Where the control turns the rotary axes, without one that the plane does not need."""
    matrix = np.eye(3) if tilt.turn is None else np.array(tilt.turn)
    try:
        found = rotary_positions(structure, matrix[:, 2])
    except ConfigError as error:
        raise ProgramError(str(error), line=tilt.line, code="OLP565") from None
    outer, inner = (name for name in structure.chain if name in _rotary(structure))
    kept = _swivelled(found, tilt, swivel_axis) if tilt.by_swivel else _signed(found, tilt, inner)
    if len(kept) != 1:
        why = (
            "no positions of the rotary axes within their travel bring the tool along the normal of this "
            "plane, as the program asks for it; turn the part, or state the travel in the machine file"
        )
        if kept:
            why = (
                "two positions of the rotary axes bring the tool along the normal, and which one the control "
                "takes is not stated; program it, or SEQ+ or SEQ- in PLANE, or swivel_axis in [kinematics]"
            )
        raise ProgramError(why, line=tilt.line, code="OLP565")
    free = np.linalg.norm(np.cross(matrix[:, 2], structure.joints[outer].direction)) < _ALONG
    if not free or tilt.turn is None:
        return kept[0]
    if not tilt.by_table or outer not in structure.workpiece_side or not _is_upright(matrix):
        return {inner: kept[0][inner]}
    return {inner: kept[0][inner], outer: _of_table(structure, outer, matrix, tilt.line)}


def _is_upright(matrix: Array) -> bool:
    """Whether a plane is turned about Z of the workpiece alone."""
    return float(matrix[2, 2]) > 1.0 - _ALONG


def _of_table(structure: Structure, letter: str, matrix: Array, line: int) -> float:
    """The position of a table at which the X axis of a plane is along that of the machine: of positions a
    whole turn apart the one nearest to zero. Raises ProgramError where its travel has none."""
    joint = structure.joints[letter]
    sense = float(np.sign(joint.direction[2]))
    value = sense * float(np.degrees(np.arctan2(matrix[1, 0], matrix[0, 0])))
    low, high = joint.travel
    inside = [value + turn for turn in (0.0, -360.0, 360.0) if low <= value + turn <= high]
    if not inside:
        raise ProgramError(
            f"the plane turns {letter} to {value:g} deg, out of its travel {low:g} to {high:g}; turn the "
            "part",
            line=line,
            code="OLP565",
        )
    return min(inside, key=abs)


def _signed(found: Sequence[Mapping[str, float]], tilt: Tilt, axis: str) -> Sequence[Mapping[str, float]]:
    """Of positions those at which an axis has the sign that the program states."""
    return [one for one in found if not tilt.branch or tilt.branch * one[axis] >= -_ZERO_DEG]


def _swivelled(
    found: Sequence[Mapping[str, float]], tilt: Tilt, swivel_axis: str
) -> Sequence[Mapping[str, float]]:
    """Of positions that a swivel finds those at the larger or the smaller value of its axis."""
    if not swivel_axis or len(found) < 2:
        return found
    best = max(tilt.branch * one[swivel_axis] for one in found)
    return [one for one in found if tilt.branch * one[swivel_axis] >= best - _ZERO_DEG]


def _rotary(structure: Structure) -> list[str]:
    return [name for name, joint in structure.joints.items() if joint.kind == "rotary"]


def refuse_off_normal(
    program: Program, structure: Structure, fixed: Mask, feed: Mask, start: Array, end: Array
) -> None:
    """Raise ProgramError for feed moves in a tilted plane whose rotary axes turn, or do not bring the tool
    along the normal; (n, axes) `start` and `end` are coordinates in the order of the structure."""
    path = program.toolpath
    rows = np.flatnonzero(fixed & feed)
    if not rows.size:
        return
    rotary = [column for column, unit in enumerate(structure.units) if unit == "deg"]
    turning = rows[(start[rows][:, rotary] != end[rows][:, rotary]).any(axis=1)]
    if turning.size:
        raise ProgramError(
            "a rotary axis turns while a tilted plane is in force, or is not known there; turn it in a "
            "rapid before, or switch tool centre point control on",
            line=int(path.line[turning[0]]),
            code="OLP565",
        )
    normals = np.array(
        [(0.0, 0.0, 1.0) if f.turn is None else [row[2] for row in f.turn] for f in path.frames]
    )
    axes = np.where(np.isfinite(end[rows]), end[rows], 0.0)
    tool = Kinematics(structure).nominal(axes).rotation[:, :, 2]
    sine = np.linalg.norm(np.cross(tool, normals[path.frame[rows]]), axis=1)
    away = np.arctan2(sine, np.sum(tool * normals[path.frame[rows]], axis=1))
    wrong = rows[away > _OFF_NORMAL]
    if wrong.size:
        raise ProgramError(
            f"the tool is {np.degrees(away[away > _OFF_NORMAL][0]):.4g} deg off the normal of the tilted "
            "plane; program the positions of the rotary axes that the plane needs before this move",
            line=int(path.line[wrong[0]]),
            code="OLP565",
        )


def refuse_lengths(program: Program, fixed: Mask, given: Mask) -> None:
    """Raise ProgramError for moves in tilted planes with linear words, `given` (n, 3), where the length of
    the tool is not in force."""
    path = program.toolpath
    without = np.array([np.isnan(frame.length_mm[2]) for frame in path.frames] or [False])[path.frame]
    wrong = np.flatnonzero(fixed & without & given.any(axis=1))
    if wrong.size:
        raise ProgramError(
            "in a tilted plane words state the tip of the tool, and the length of the tool in the spindle is "
            "not in force; switch it on before this move",
            line=int(path.line[wrong[0]]),
            code="OLP565",
        )


def stated_afresh(program: Program, fixed: Mask, degrees: Array) -> Mask:
    """(n,) moves in tilted planes before which a rotary axis or the plane has turned, and those that the
    control makes by itself: coordinates count from here on only where they are stated."""
    path = program.toolpath
    turned = np.append(True, (degrees[1:] != degrees[:-1]).any(axis=1))[: len(path)]
    places = list(dict.fromkeys((frame.turn, frame.offset_mm) for frame in path.frames))
    place = np.array([places.index((f.turn, f.offset_mm)) for f in path.frames] or [0])[path.frame]
    other = np.append(True, place[1:] != place[:-1])[: len(path)]
    lost = (path.flag & np.uint8(Flag.CONTROL)) != 0
    return np.asarray(fixed & (turned | other | lost), bool)


def stands_before(fixed: Mask, feed: Mask, degrees: Array) -> Mask:
    """(n,) moves in tilted planes, and the rapids before these with the same rotary positions."""
    held = fixed.copy()
    for first in np.flatnonzero(fixed[1:] & ~fixed[:-1]).tolist():
        row = first
        while row >= 0 and not feed[row] and not held[row] and (degrees[row] == degrees[row + 1]).all():
            held[row] = True
            row -= 1
    return held
