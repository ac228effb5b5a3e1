"""Datum shift, mirror and rotation as a program sets them, for positions in the plane of X and Y.

A word counts in the innermost system: `shift + mirror * rotation * word`. That is what a control makes of
them where a program sets the shift first, then the mirror, then the rotation. Where it sets them in another
order, controls differ, and the program is refused.
"""

from __future__ import annotations

import math
import re

from olp.core.errors import ProgramError
from olp.program.heidenhain.statements import CycleText, Statement

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_TURN = re.compile(rb"\A(I?)ROT[ \t]*(" + _NUMBER + rb")[ \t]*\Z", re.I)
_SCALE = re.compile(rb"(?:SCL|[XYZ])[ \t]*(" + _NUMBER + rb")", re.I)
_AXES = re.compile(rb"[ \t,]*([XYZ])", re.I)
#: CYCL DEF of the datum shift.
SHIFT = 7
#: CYCL DEF of the mirror.
MIRROR = 8
#: CYCL DEF of the rotation.
ROTATION = 10
#: CYCL DEF of the scale of all axes.
SCALING = 11
#: CYCL DEF of scales by axis.
SCALINGS = 26
#: cycles whose statements are gone from the text that is written out
WRITTEN_OUT = (MIRROR, ROTATION)

Point = tuple[float, float]


class Transformation:
    """The present transformation; `shift` by axis in the unit of the program."""

    def __init__(self) -> None:
        self.shift = [0.0, 0.0, 0.0]
        self.mirror = (1.0, 1.0)
        self.degrees = 0.0

    @property
    def turned(self) -> bool:
        """Whether words differ from distances along the axes of the shifted system."""
        return self.degrees % 360.0 != 0.0 or self.mirror != (1.0, 1.0)

    @property
    def flips(self) -> bool:
        """Whether it turns the direction of arcs."""
        return self.mirror[0] * self.mirror[1] < 0

    def outward(self, x: float, y: float) -> Point:
        """A direction or a position about the datum, from words to the axes."""
        if self.degrees % 360.0:
            c, s = self._turn()
            x, y = c * x - s * y, s * x + c * y
        return self.mirror[0] * x, self.mirror[1] * y

    def inward(self, x: float, y: float) -> Point:
        """The inverse of `outward`."""
        x, y = self.mirror[0] * x, self.mirror[1] * y
        if self.degrees % 360.0:
            c, s = self._turn()
            x, y = c * x + s * y, -s * x + c * y
        return x, y

    def _turn(self) -> Point:
        angle = math.radians(self.degrees)
        return math.cos(angle), math.sin(angle)

    def take(self, cycle: CycleText, statement: Statement) -> None:
        """Take over a CYCL DEF of a transformation. Raises ProgramError where it is not read."""
        if cycle.number == SHIFT and cycle.part:
            self._shift(statement)
        elif cycle.number == MIRROR and cycle.part:
            self._mirror(cycle, statement.line)
        elif cycle.number == ROTATION and cycle.part:
            self._rotation(cycle, statement.line)
        elif cycle.part and any(float(v) != 1.0 for v in _SCALE.findall(cycle.rest)):
            raise ProgramError(
                f"CYCL DEF {cycle.number} scales, and which axes and depths it scales is not known here; "
                "write the scaled positions",
                line=statement.line,
                code="OLP512",
            )

    def _shift(self, statement: Statement) -> None:
        shift = list(self.shift)
        for letter, (adds, value) in statement.numbers().items():
            axis = b"XYZ".find(letter)
            if axis >= 0:
                shift[axis] = value + (shift[axis] if adds else 0.0)
        if self.turned and shift[:2] != self.shift[:2] and any(shift[:2]):
            raise ProgramError(
                "the datum is shifted (CYCL DEF 7) in a rotated or mirrored program, and controls differ in "
                "what that means; shift it before CYCL DEF 8 and 10",
                line=statement.line,
                code="OLP512",
            )
        self.shift = shift

    def _mirror(self, cycle: CycleText, line: int) -> None:
        rest = cycle.rest.strip()
        axes = {a.upper() for a in _AXES.findall(rest)}
        if b"Z" in axes or (rest and not axes) or _AXES.sub(b"", rest).strip():
            raise ProgramError(
                "CYCL DEF 8 mirrors another axis than X and Y, which is not read; write what it makes",
                line=line,
                code="OLP512",
            )
        mirror = (-1.0 if b"X" in axes else 1.0, -1.0 if b"Y" in axes else 1.0)
        if self.degrees % 360.0 and mirror != self.mirror:
            raise ProgramError(
                "the program is mirrored (CYCL DEF 8) while it is rotated, and controls differ in what that "
                "means; mirror it before CYCL DEF 10",
                line=line,
                code="OLP512",
            )
        self.mirror = mirror

    def _rotation(self, cycle: CycleText, line: int) -> None:
        match = _TURN.match(cycle.rest.strip())
        if match is None:
            raise ProgramError("CYCL DEF 10 has no ROT with a number; give it", line=line, code="OLP516")
        self.degrees = float(match[2]) + (self.degrees if match[1] else 0.0)
