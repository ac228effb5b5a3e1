"""Tilted planes of ISO controls: G68.2 with Euler angles, G53.1, which turns the tool along their normal, and
G69, which ends them.

Source: Fanuc, Operator's Manual of series 30i, section "Tilted working plane indexing".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.errors import ProgramError
from olp.core.geometry import rotation_matrix
from olp.core.turns import rows_of
from olp.program.frames import Placement
from olp.program.rs274.codes import ALIGNED, TILTED
from olp.program.rs274.offset_state import OffsetState, Word
from olp.program.tilts import Tilt

_STATED = "XYZIJK"


def tilted(state: OffsetState, code: int, line: int, by_letter: Mapping[str, Word]) -> list[Tilt]:
    """Carry out a code of tilted planes; returns where the control turns rotary axes. No position is known
    then until it is stated."""
    offsets = state.offsets
    if code == ALIGNED:
        if offsets.plane is None or "P" in by_letter or offsets.tip:
            raise _refusal("G53.1 is read alone, in a plane of G68.2, before tool centre point control", line)
        state.forget()
        return [Tilt(-1, line, "", offsets.plane.turn, 0)]
    if code == TILTED:
        _check(state, line, by_letter)
        (x, y, z), angles = (
            [state.length_mm(by_letter[letter]) for letter in "XYZ"],
            [by_letter[letter].value for letter in "IJK"],
        )
        matrix = np.eye(3)
        for axis, angle in zip("CAC", angles, strict=True):
            matrix = matrix @ rotation_matrix((angle, 0.0, 0.0) if axis == "A" else (0.0, 0.0, angle))
        matrix = np.where(np.abs(matrix) < 1e-15, 0.0, matrix)
        offsets.plane = Placement(rows_of(matrix) if any(angles) else None, (x, y, z))
    else:
        offsets.plane = None
    state.forget()
    return []


def _check(state: OffsetState, line: int, by_letter: Mapping[str, Word]) -> None:
    offsets = state.offsets
    if offsets.plane is not None or offsets.transform is not None or offsets.tip or any(offsets.shift):
        raise _refusal(
            "G68.2 comes in another plane, a turned program, G92 or tool centre point control; give G69, "
            "G92.1 or G49 before it",
            line,
        )
    if not state.absolute or any(offsets.local) or not set(_STATED) <= set(by_letter) or "P" in by_letter:
        raise _refusal("G68.2 is read in G90, without G52, with X, Y, Z, I, J and K, and without P", line)
    if state.profile.increments_without_point:
        for letter in "IJK":
            if by_letter[letter].value and not by_letter[letter].pointed:
                raise _refusal(
                    f"{letter} of G68.2 has no decimal point, so a parameter of the control decides what it "
                    "counts; write the point",
                    line,
                )


def _refusal(why: str, line: int) -> ProgramError:
    return ProgramError(why, line=line, code="OLP518")
