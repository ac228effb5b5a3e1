"""Scaling as a program sets it: CYCL DEF 11, one factor, and CYCL DEF 26, one for each axis about a centre.

A word w becomes `centre + factor * (w - centre)`. Whether CYCL DEF 11 scales the tool axis too differs among
controls, and on some a machine parameter decides it (MP7410 of the iTNC 530), so the machine file states it.
"""

from __future__ import annotations

import math
import re
from typing import Literal

from olp.core.errors import ProgramError
from olp.program.heidenhain.statements import CycleText

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_FACTOR = re.compile(rb"\ASCL[ \t]*(" + _NUMBER + rb")[ \t]*\Z", re.I)
_BY_AXIS = re.compile(rb"(CC)?([XYZ])[ \t]*(" + _NUMBER + rb")", re.I)
#: CYCL DEF of the scale of all axes.
SCALING = 11
#: CYCL DEF of scales by axis.
SCALINGS = 26


class Scaling:
    """The scaling in force: `factors` and `centre` by axis. A factor that is not known is NaN."""

    def __init__(self, axes: Literal["plane", "all"] | None) -> None:
        self.axes = axes
        self.factors = [1.0, 1.0, 1.0]
        self.centre = [0.0, 0.0, 0.0]
        self._number = 0

    @property
    def off(self) -> bool:
        return self.factors == [1.0, 1.0, 1.0]

    @property
    def size(self) -> float:
        """How radii in the plane of X and Y are scaled; NaN where the factors of X and Y differ."""
        return self.factors[0] if self.factors[0] == self.factors[1] else math.nan

    def outward(self, axis: int, word: float) -> float:
        return self.centre[axis] + self.factors[axis] * (word - self.centre[axis])

    def inward(self, axis: int, value: float) -> float:
        return self.centre[axis] + (value - self.centre[axis]) / self.factors[axis]

    def take(self, cycle: CycleText, line: int) -> None:
        """Take over a part of CYCL DEF 11 or 26. Raises ProgramError for what is no factor above zero."""
        rest = cycle.rest.strip()
        own = cycle.number == self._number
        factors, centre = (list(self.factors), list(self.centre)) if own else ([1.0] * 3, [0.0] * 3)
        if cycle.number == SCALING:
            match = _FACTOR.match(rest)
            value = float(match[1]) if match else 0.0
            along = {"plane": 1.0, "all": value, None: value if value == 1.0 else math.nan}[self.axes]
            factors = [value, value, along]
        else:
            found = {(bool(cc), a.upper()): float(v) for cc, a, v in _BY_AXIS.findall(rest)}
            for _, letter in found:
                axis = b"XYZ".index(letter)
                factors[axis] = found.get((False, letter), factors[axis])
                centre[axis] = found.get((True, letter), 0.0)
            if not found or _BY_AXIS.sub(b"", rest).strip():
                factors = [0.0]
        if not all(f > 0.0 or math.isnan(f) for f in factors):
            raise ProgramError(
                f"CYCL DEF {cycle.number} needs factors above zero; give SCL 0.5, or X0.5 Y0.5 with CCX, CCY",
                line=line,
                code="OLP516",
            )
        if cycle.number != self._number and not self.off:
            if factors == [1.0, 1.0, 1.0]:
                return
            raise ProgramError(
                "CYCL DEF 11 and 26 are both in force; give one of them the factor 1 before",
                line=line,
                code="OLP518",
            )
        self.factors, self.centre, self._number = factors, centre, cycle.number
