"""Cutter compensation (G40 to G42) as the reader follows it: the side, the radius, what may not be in it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

from olp.core.errors import ProgramError
from olp.core.machine import Setup, Tool
from olp.core.toolpath import CutterCompensation
from olp.program.rs274.codes import (
    COMPENSATION_BY_DIAMETER,
    COMPENSATION_LEFT,
    MACHINE,
    PLANE_OF,
    PROBES,
    UNITS,
)
from olp.program.rs274.offset_state import Word
from olp.program.rs274.profiles.base import Profile

#: What a control refuses in cutter compensation, beside what changes offsets.
_REFUSED = PROBES | {MACHINE, *UNITS}
#: M0, M1 and M60, ten times their number: a control ends its path before it stops.
STOPS = frozenset({0, 10, 600})


class _State(Protocol):
    profile: Profile
    plane: int
    spindle: int | None
    compensation: CutterCompensation | None
    contours: int
    radius_number: int | None

    @property
    def setup(self) -> Setup: ...
    def length_mm(self, word: Word) -> float: ...


def switched_on(state: _State, code: int, line: int, by_letter: Mapping[str, Word]) -> CutterCompensation:
    """The compensation that G41 or G42 begins: D is the number of a tool, or a diameter; without it the tool
    in the spindle counts on controls that take its length too. Raises ProgramError where the radius is not
    known, or the control refuses the block."""
    if state.compensation is not None:
        raise ProgramError(
            "cutter compensation is on already, and how the control goes over is not known; program G40 "
            "between the two contours",
            line=line,
            code="OLP528",
        )
    plane = PLANE_OF[state.plane]
    if plane not in state.profile.contours.planes:
        raise ProgramError(
            "this control has no cutter compensation in this plane; program the path of the tool",
            line=line,
            code="OLP518",
        )
    if code in COMPENSATION_BY_DIAMETER:
        if "D" not in by_letter:
            raise ProgramError(
                f"G{code / 10:g} needs a D word with the diameter of the cutter", line=line, code="OLP516"
            )
        radius_mm = state.length_mm(by_letter["D"]) / 2
    else:
        radius_mm = _radius_mm(state, code, line, by_letter.get("D"))
    state.contours += 1
    left = (code in COMPENSATION_LEFT) == (radius_mm >= 0)
    return CutterCompensation(plane, left, abs(radius_mm), state.contours)


def _radius_mm(state: _State, code: int, line: int, word: Word | None) -> float:
    """The radius in the tool table; D0 is none on controls where it is no tool."""
    number = None if word is None else round(word.value)
    if word is not None and (word.value != number or word.value < 0):
        raise ProgramError(
            f"D{word.value:g} is not a number of a table; expected an integer from 0",
            line=line,
            code="OLP516",
        )
    if word is None and state.profile.radius_holds:
        number = state.radius_number
    if state.profile.length_of_spindle_tool:
        number = number or state.spindle
        if number == 0:
            return 0.0
    elif number == 0:
        return 0.0
    if number is None:
        own = state.profile.length_of_spindle_tool
        why = "the tool in the spindle is not known; give D, or T and M6 before it"
        why = why if own else "which radius it takes is not known; give D"
        raise ProgramError(
            f"G{code / 10:g} has no D word, and {why}",
            line=line,
            code="OLP513",
        )
    tool: Tool | None = state.setup.tool(number)
    if tool is None or tool.radius_mm is None:
        raise ProgramError(
            f"the control makes the path of the tool from the radius of tool {number}, which is not known; "
            f"give radius_mm, and wear_mm, in [tools.{number}] of the machine or job file",
            line=line,
            code="OLP513",
            missing=("tools", str(number)),
        )
    return tool.radius_mm + tool.wear_mm


def check_block(state: _State, codes: Sequence[int], line: int, *, changes_tool: bool) -> None:
    """Refuse what a control does not take while cutter compensation is on."""
    if state.compensation is None:
        return
    if changes_tool:
        what = "a tool change is"
    elif _REFUSED.intersection(codes):
        what = "units, probing or machine positions are"
    elif state.compensation.plane != PLANE_OF[state.plane]:
        what = "a change of plane is"
    else:
        return
    raise ProgramError(f"{what} in cutter compensation; give G40 before", line=line, code="OLP518")


def check_codes_along(state: _State, codes: Collection[int], m_codes: Collection[int], line: int) -> None:
    """Refuse codes of a block, ten times their number, that a control does not take in the compensation that
    is on behind it, and stops. The control ends its path there, so it makes no corner with the next move."""
    if state.compensation is None:
        return
    rules = state.profile.contours
    names = [f"G{code / 10:g}" for code in codes if code in rules.refused_g]
    names += [f"M{code / 10:g}" for code in m_codes if code in rules.refused_m]
    if names:
        why = "is not taken by this control in cutter compensation"
    elif state.compensation.radius_mm and not STOPS.isdisjoint(m_codes):
        names = [f"M{code / 10:g}" for code in m_codes if code in STOPS]
        why = "stops the control in cutter compensation, which makes no corner with the next move then"
    else:
        return
    where = "put it before the contour, or behind G40"
    raise ProgramError(f"{names[0]} {why}; {where}", line=line, code="OLP518")
