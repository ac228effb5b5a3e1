"""What is not corrected on machines with rotary joints, with the line where it is."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.core.turns import Turn
from olp.kinematics.structure import Structure
from olp.program.heidenhain.columns import OTHER_STEP
from olp.program.program import Program
from olp.program.rs274.profiles.base import Profile

#: A matrix whose rows are so near to orthonormal ones is a rotation.
_ROTATION = 1e-9
#: Moves that are never corrected.
KEPT = np.uint8(Flag.PASS | Flag.MACHINE | Flag.CONTROL)


def refuse_tips(
    program: Program, structure: Structure, tip: Mask, end: Array, offset: Array, from_zero: bool | None
) -> None:
    """Raise ProgramError where the tip is stated in a frame that is not known."""
    moves = np.flatnonzero(tip)
    if not moves.size:
        return
    path = program.toolpath
    rotary = np.array([unit == "deg" for unit in structure.units])
    begun = moves[np.append(True, np.diff(moves) != 1)]
    before = np.vstack((np.full(len(rotary), np.nan), end))[begun]
    carried = rotary & np.array([name in structure.workpiece_side for name in structure.order])
    turned = ~(before[:, carried] == 0.0)
    for row in np.flatnonzero(turned.any(axis=1) if from_zero is not True else np.zeros(len(begun), bool)):
        raise ProgramError(
            "tool centre point control is switched on where a table axis is not at zero; turn it to zero "
            'before, or state tcp_frame_zero = "axis-zero" in [kinematics] where the control has it so',
            line=int(path.line[begun[row]]),
            code="OLP565",
        )
    shifted = moves[(offset[moves][:, rotary] != 0.0).any(axis=1)]
    if shifted.size:
        raise ProgramError(
            "with tool centre point control the work offset has rotary values; expected 0 for A, B and C",
            line=int(path.line[shifted[0]]),
            code="OLP565",
        )
    if isinstance(program.dialect, Profile) and program.dialect.tip_codes:
        _refuse_lengths(program, moves)


def _refuse_lengths(program: Program, moves: Index) -> None:
    """Raise ProgramError where tool centre point control takes the length of another tool than the one in the
    spindle."""
    words, path = program.words, program.toolpath
    assert words is not None
    index = np.flatnonzero(words.letter == ord("H"))
    line = np.searchsorted(words.first_word, index, "right")
    first = np.searchsorted(path.line, line)
    inside = (first < len(path)) & is_in(np.minimum(first, len(path) - 1), moves)
    for number, at, move in zip(
        words.mantissa[index[inside]].tolist(), line[inside].tolist(), first[inside].tolist(), strict=True
    ):
        tool = path.frames[int(path.frame[move])].tool
        if tool != number:
            raise ProgramError(
                f"H{number} is the length of another tool than T{tool}, which is "
                "in the spindle; expected the "
                "number of that tool, whose vector is that of [tools.N]",
                line=at,
                code="OLP565",
            )


def refuse_unread(program: Program) -> None:
    """Raise ProgramError with the first line of what is not corrected on machines with rotary joints."""
    path = program.toolpath
    found: list[tuple[int, str]] = []

    def note(moves: Mask, why: str) -> None:
        if moves.any():
            found.append((int(path.line[moves].min()), why))

    flag = path.flag
    if program.statements is not None:
        note((flag & np.uint8(Flag.INCREMENTAL)) != 0, "a distance (I); program the position")
        note(_turned_by(program), "a distance (I) of a rotary axis; program the position")
    note(path.compensated(), "cutter compensation (G41, G42); post the path of the tool's centre")
    note(path.kind == Kind.PROBE, "a probing move; take it into a program of its own")
    note((flag & np.uint8(Flag.DELETED)) != 0, "a block under block delete; remove the / or the block")
    arc = np.zeros(len(path), bool)
    arc[path.arcs.move] = True
    if program.arc_slots.poles is None and not (
        program.statements is None and isinstance(program.dialect, Profile)
    ):
        note(arc & ((flag & KEPT) == 0), "an arc; post it as straight moves, within your tolerance")
    other = np.array([frame.turn is not None and not _is_rotation(frame.turn) for frame in path.frames], bool)
    if other.any():
        note(other[path.frame], "a mirrored or scaled frame; post the program without it")
    for capture in program.captures[:1]:
        found.append((capture.line, "a word that stores the present position (G92, G10 L20); use G54 to G59"))
    if found:
        line, why = min(found)
        raise ProgramError(
            f"on a machine with rotary joints this is not corrected: {why}", line=line, code="OLP565"
        )


def _turned_by(program: Program) -> Mask:
    """(n,) moves of a conversational program with a distance of a rotary axis."""
    words, line = program.words, program.toolpath.line
    assert words is not None
    stepped = np.searchsorted(words.first_word, np.flatnonzero(words.letter == OTHER_STEP), "right")
    return np.asarray(is_in(line, distinct(stepped)), bool)


def _is_rotation(turn: Turn) -> bool:
    matrix = np.array(turn)
    return bool(np.abs(matrix @ matrix.T - np.eye(3)).max() < _ROTATION and np.linalg.det(matrix) > 0.0)
