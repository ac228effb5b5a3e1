"""CYCLE800 of Sinumerik programs: a swivelled plane as a frame, and where the control turns the rotary axes.

Source: Siemens, Operating Manual Milling, section "Swivel plane (CYCLE800)", and its programming interface.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.errors import ProgramError
from olp.core.geometry import rotation_matrix
from olp.core.machine import Vector
from olp.core.turns import Turn, rows_of
from olp.core.values import dataclass
from olp.program.frames import Placement, turned
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.translation import Action
from olp.program.sinumerik.actions import outside_contours
from olp.program.sinumerik.blocks import NUMBER
from olp.program.tilts import Branch, Tilt

#: The places of the arguments.
_RETRACT = 0
_STATE = 2
_MODE = 3
_BEFORE = 4
_ANGLES = 7
_BEHIND = 10
_DIRECTION = 13
#: Tens of _ST: the tip of the tool follows, or not; both leave the linear axes anywhere.
_STATES = (0, 1, 10, 11)
#: An additive swivel.
_ADDS = 1


@dataclass(frozen=True, slots=True)
class Swivel(Action):
    """A swivelled plane: a point w of the program becomes `turn` (w + `behind`) + `before`, in program units.
    `direction` is _DIR, 0 where no axis turns. `adds` to the plane in force; `ends` it."""

    turn: Turn | None
    before: Vector
    behind: Vector
    direction: Branch
    retracts: bool
    adds: bool = False
    ends: bool = False

    def moves(self, state: AxisState) -> bool:
        return self.retracts or bool(self.direction)

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a swivelled plane is", line)
        offsets = state.offsets
        if offsets.tip or any(offsets.local) or offsets.transform is not None:
            raise ProgramError(
                "CYCLE800 comes with TRAORI or a programmable frame in force, and machine data say what "
                "becomes of that; program TRAFOOF, and TRANS without values, before it",
                line=line,
                code="OLP518",
            )
        if self.adds and offsets.plane is not None:
            raise ProgramError(
                "CYCLE800 adds to the plane in force (_ST 1), which is not read; program a new plane",
                line=line,
                code="OLP512",
                word="CYCLE800",
            )
        state.forget()
        if self.ends:
            offsets.plane = None
            return
        unit = state.unit_mm
        shift = turned(self.turn, self.behind)
        x, y, z = ((a + b) * unit for a, b in zip(self.before, shift, strict=True))
        offsets.plane = Placement(self.turn, (x, y, z))
        if self.direction:
            state.tilts.append(Tilt(-1, line, "", self.turn, self.direction, by_swivel=True))


def swivel(given: Sequence[bytes]) -> Swivel:
    """What the arguments of CYCLE800 say. Raises ProgramError without a line for what is not read."""
    if not any(given):
        return Swivel(None, (0.0,) * 3, (0.0,) * 3, 0, retracts=False, ends=True)
    padded = [*given, *([b""] * (_DIRECTION + 3 - len(given)))]
    numbers = [_number(text) for k, text in enumerate(padded) if k != 1]
    numbers.insert(1, 0.0)
    state, mode, direction = (round(numbers[k]) for k in (_STATE, _MODE, _DIRECTION))
    if state not in _STATES or direction not in (-1, 0, 1) or any(numbers[_DIRECTION + 2 :]):
        raise _refusal("_ST is not 0, 1, 10 or 11, _DIR not -1, 0 or 1, or _DMODE is stated")
    angles = numbers[_ANGLES : _ANGLES + 3]
    stated = any(angles) or bool(padded[_MODE])
    if any(angles) and not padded[_DIRECTION]:
        raise _refusal("_DIR is left out; write -1, 0 or 1")
    if not stated and not any(numbers[_BEFORE:_DIRECTION]) and not padded[_DIRECTION]:
        return Swivel(None, (0.0,) * 3, (0.0,) * 3, 0, retracts=bool(numbers[_RETRACT]), ends=True)
    matrix = np.eye(3)
    order = [mode >> shift & 3 for shift in (0, 2, 4)]
    if any(angles) and (mode >> 6 or sorted(order) != [1, 2, 3]):
        raise _refusal("_MODE does not turn about X, Y and Z one after the other, as 57 and 27 do")
    for axis, angle in zip(order, angles, strict=True):
        if angle:
            turn = [0.0, 0.0, 0.0]
            turn[axis - 1] = angle
            matrix = matrix @ rotation_matrix((turn[0], turn[1], turn[2]))
    matrix = np.where(np.abs(matrix) < 1e-15, 0.0, matrix)
    before, behind = (numbers[k : k + 3] for k in (_BEFORE, _BEHIND))
    chosen: Branch = 0 if not direction else 1 if direction > 0 else -1
    return Swivel(
        rows_of(matrix) if any(angles) else None, (before[0], before[1], before[2]),
        (behind[0], behind[1], behind[2]), chosen, retracts=bool(numbers[_RETRACT]),
        adds=state % 10 == _ADDS,
    )  # fmt: skip


def _number(text: bytes) -> float:
    if not text:
        return 0.0
    if not NUMBER.fullmatch(text):
        raise _refusal(f"{text.decode('latin-1')} is no number")
    return float(text)


def _refusal(why: str) -> ProgramError:
    return ProgramError(f"CYCLE800 is not read so: {why}", code="OLP512", word="CYCLE800")
