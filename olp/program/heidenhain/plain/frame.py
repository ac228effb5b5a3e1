"""Datum shift, mirror, rotation and scaling as a program sets them, for positions in the plane of X and Y.

A word counts in the innermost system: `shift + mirror * rotation * scaling * word`. That is what a control
makes of them where a program sets them in this order. Where the order counts and it is another one, controls
differ, and the program is refused.
"""

from __future__ import annotations

import math
import re
from typing import Literal

from olp.core.errors import ProgramError
from olp.program.heidenhain.plain.scaling import SCALING, SCALINGS, Scaling
from olp.program.heidenhain.statements import CycleText, Statement

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_TURN = re.compile(rb"\A(I?)ROT[ \t]*(" + _NUMBER + rb")[ \t]*\Z", re.I)
_AXES = re.compile(rb"[ \t,]*([XYZ])", re.I)
#: CYCL DEF of the datum shift.
SHIFT = 7
#: CYCL DEF of the mirror.
MIRROR = 8
#: CYCL DEF of the rotation.
ROTATION = 10
#: cycles whose statements are gone from the text that is written out
WRITTEN_OUT = (MIRROR, ROTATION, SCALING, SCALINGS)

Point = tuple[float, float]


class Transformation:
    """The present transformation; `shift` by axis in the unit of the program. `scaling_axes` are those that
    CYCL DEF 11 scales, None where that is not stated."""

    def __init__(self, scaling_axes: Literal["plane", "all"] | None) -> None:
        self.scaling = Scaling(scaling_axes)
        self.shift = [0.0, 0.0, 0.0]
        self.mirror = (1.0, 1.0)
        self.degrees = 0.0

    @property
    def turned(self) -> bool:
        """Whether words of X and Y differ from distances along the axes of the shifted system."""
        return (
            self.degrees % 360.0 != 0.0 or self.mirror != (1.0, 1.0) or self.scaling.factors[:2] != [1.0, 1.0]
        )

    @property
    def lifts(self) -> bool:
        """Whether words of Z do."""
        return self.scaling.factors[2] != 1.0

    @property
    def flips(self) -> bool:
        """Whether it turns the direction of arcs."""
        return self.mirror[0] * self.mirror[1] < 0

    def outward(self, x: float, y: float) -> Point:
        """A position about the datum, from words to the axes."""
        x, y = self.scaling.outward(0, x), self.scaling.outward(1, y)
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
        return self.scaling.inward(0, x), self.scaling.inward(1, y)

    def up(self, z: float, line: int) -> float:
        """Along Z what `outward` is across. Raises ProgramError where it is not known what is scaled."""
        if math.isnan(self.scaling.factors[2]):
            raise ProgramError(
                "Z is programmed under CYCL DEF 11, and controls differ in whether it scales the tool axis; "
                'state scaling_axes = "all" or "plane" in the machine file',
                line=line,
                code="OLP512",
            )
        return self.scaling.outward(2, z)

    def _turn(self) -> Point:
        angle = math.radians(self.degrees)
        return math.cos(angle), math.sin(angle)

    def take(self, cycle: CycleText, statement: Statement) -> None:
        """Take over a CYCL DEF of a transformation. Raises ProgramError where it is not read."""
        if cycle.number == SHIFT and cycle.part:
            self._shift(cycle, statement)
        elif cycle.number == MIRROR and cycle.part:
            self._mirror(cycle, statement.line)
        elif cycle.number == ROTATION and cycle.part:
            self._rotation(cycle, statement.line)
        elif cycle.part:
            self.scaling.take(cycle, statement.line)
            self._check_order(statement.line)

    def _check_order(self, line: int) -> None:
        """Factors that differ do not go with a rotation, as the order counts there."""
        if self.degrees % 360.0 and math.isnan(self.scaling.size):
            raise ProgramError(
                "X and Y are scaled by different factors (CYCL DEF 26) in a rotated program, and controls "
                "differ in what that means; write the positions",
                line=line,
                code="OLP512",
            )

    def _shift(self, cycle: CycleText, statement: Statement) -> None:
        shift = list(self.shift)
        for letter, adds, value in cycle.shifts(statement):
            axis = "XYZ".find(letter)
            if axis >= 0:
                shift[axis] = float(value) + (shift[axis] if adds else 0.0)
        across = self.turned and shift[:2] != self.shift[:2] and any(shift[:2])
        if across or (self.lifts and shift[2] != self.shift[2] and shift[2]):
            raise ProgramError(
                "the datum is shifted (CYCL DEF 7) in a rotated, mirrored or scaled program, and controls "
                "differ in what that means; shift it before CYCL DEF 8, 10, 11 and 26",
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
        self._check_order(line)
