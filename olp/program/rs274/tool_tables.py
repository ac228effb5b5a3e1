"""G10 L10 to L13 of ISO controls, which write lengths, radii and their wear into the tables of tools.

The lengths and radii of the machine file count. A program that writes the same is read, another is refused:
its tools were measured otherwise than the file says.
"""

from __future__ import annotations

from typing import Protocol

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.units import AXES
from olp.program.rs274.profiles.base import Profile

#: mm by which a stated number may differ: half of 0.0001 inch, to which programs are rounded
_SAME_MM = 1.28e-3
#: what each L writes
_WRITTEN = {10: "a length", 11: "the wear of a length", 12: "a radius", 13: "the wear of a radius"}


class _State(Protocol):
    profile: Profile

    @property
    def setup(self) -> Setup: ...
    @property
    def absolute(self) -> bool: ...


def writes_tool(state: _State, kind: int) -> bool:
    """Whether G10 with this L writes the table of a tool."""
    return state.profile.g10_tools and kind in _WRITTEN


def check_tool(state: _State, kind: int, number: int, mm: float, line: int) -> None:
    """Refuse a G10 that writes other numbers than the machine file has. A radius may be stated as a diameter,
    which is a setting of the control."""
    tool = state.setup.tool(number)
    if tool is None:
        raise ProgramError(
            f"G10 L{kind} writes {_WRITTEN[kind]} of tool {number}, which is not defined; give "
            f"[tools.{number}] in the machine or job file",
            line=line,
            code="OLP521",
            missing=("tools", str(number)),
        )
    radius = tool.radius_mm if kind == 12 else tool.wear_mm
    stated = {
        10: [tool.length_mm[AXES.index("Z")]],
        11: [0.0],
    }.get(kind, [] if radius is None else [radius, 2.0 * radius])
    if not state.absolute or not any(abs(mm - own) < _SAME_MM for own in stated):
        key = {10: "Z_mm", 11: "Z_mm, with its wear,", 12: "radius_mm", 13: "wear_mm"}[kind]
        raise ProgramError(
            f"G10 L{kind} writes {_WRITTEN[kind]} of tool {number} that is not the one of the machine file; "
            f"give {key} in [tools.{number}] as the program writes it, and the program in G90"
            + (", or leave L11 out" if kind == 11 else ""),
            line=line,
            code="OLP526",
        )
