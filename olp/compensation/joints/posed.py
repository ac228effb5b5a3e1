"""What programs whose words state poses have to keep to: poses within reach, by turns that one triple of
words states."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.compensation.joints.drilled import Drilled
from olp.compensation.joints.motion import Motion
from olp.core.arrays import Array, Index
from olp.core.errors import NotInvertible, ProgramError
from olp.core.units import AXES
from olp.kinematics.coordinates import TURNS, Coordinates
from olp.program.program import Program

#: deg; nearer to a right angle B is stated with any share of its turn in A or in C.
_NEAR_RIGHT_DEG = 1.0


def refuse_poses(
    program: Program, words: Coordinates, motion: Motion, end: Array, tool: Index, holes: Drilled
) -> None:
    """Where words state poses, raise ProgramError for those that the axes do not reach, turns that other
    words state nearly as well, and cycles."""
    if not words.poses:
        return
    line = program.toolpath.line
    if holes.strokes.any():
        raise ProgramError(
            "where words state poses this is not corrected: a canned cycle; give --expand-cycles, which "
            "writes it out as moves",
            line=int(line[holes.strokes].min()),
            code="OLP565",
        )
    if len(words.names) == len(AXES) + len(TURNS):
        _refuse_right_angles(end[:, words.names.index("B")], line)
    try:
        motion.axes(end, tool, np.ones(len(end), bool))
    except NotInvertible as error:
        raise ProgramError.together(
            ProgramError(
                "no axis values bring the tool to this pose; expected one within reach, with the work offset "
                "and the tool of the machine file",
                line=int(line[row]),
                code="OLP566",
            )
            for row in error.rows
        ) from None


def _refuse_right_angles(tilt_deg: Array, line: npt.NDArray[np.int32]) -> None:
    """Raises ProgramError where the B of ends (n,) is at a right angle, or on the other side of one."""
    side = np.round(tilt_deg / 180.0)
    near = np.abs(tilt_deg - 180.0 * side) > 90.0 - _NEAR_RIGHT_DEG
    across = np.append(False, side[1:] - side[:-1] != 0.0)[: len(side)]
    across &= np.isfinite(side) & np.isfinite(np.append(np.nan, side[:-1])[: len(side)])
    if (near | across).any():
        raise ProgramError(
            f"B turns the tool to within {_NEAR_RIGHT_DEG:g} deg of a right angle, or across one, where A "
            "and C turn it alike; clamp the part in another way",
            line=int(line[np.argmax(near | across)]),
            code="OLP565",
        )


def unreached(line: int) -> ProgramError:
    """Why a move is refused along which directions of the tool are not reached."""
    return refused(
        "along this move the tool has places or directions that no axis values near by give; split it, or "
        "lead it by the axes",
        line,
    )


def refused(what: str, line: int) -> ProgramError:
    """Why a move is refused that no axis values lead."""
    return ProgramError(what, line=line, code="OLP566")
