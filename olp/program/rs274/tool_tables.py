"""G10 of tools: L10 to L13 of ISO controls write lengths, radii and their wear, L1 of LinuxCNC all of a tool.

The lengths and radii of the machine file count. A program that writes the same is read, another is refused:
its tools were measured otherwise than the file says.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from olp.core.errors import ProgramError
from olp.core.machine import Setup, Tool
from olp.program.rs274.profiles.base import Profile

#: mm by which a stated number may differ: half of 0.0001 inch, to which programs are rounded
_SAME_MM = 1.28e-3
#: L of LinuxCNC, which writes the lengths along axes and the radius of a tool
_ENTRY = 1
#: what each L writes
_WRITTEN = {
    _ENTRY: "lengths or the radius", 10: "a length", 11: "the wear of a length", 12: "a radius",
    13: "the wear of a radius",
}  # fmt: skip
_KEYS = {10: "Z_mm", 11: "Z_mm, with its wear,", 12: "radius_mm", 13: "wear_mm"}


class _State(Protocol):
    profile: Profile

    @property
    def setup(self) -> Setup: ...
    @property
    def absolute(self) -> bool: ...


def words_of_tool(state: _State, kind: int) -> str:
    """The letters of what G10 with this L writes into the table of a tool; none where it writes no such."""
    if kind not in state.profile.g10_tools:
        return ""
    return "XYZR" if kind == _ENTRY else "R"


def check_tool(state: _State, kind: int, number: int, stated: Mapping[str, float], line: int) -> None:
    """Refuse a G10 that writes other numbers than the machine file has. `stated` are its words in mm. A
    radius may be stated as a diameter on ISO controls, which is a setting of the control."""
    tool = state.setup.tool(number)
    if tool is None:
        raise ProgramError(
            f"G10 L{kind} writes {_WRITTEN[kind]} of tool {number}, which is not defined; give "
            f"[tools.{number}] in the machine or job file",
            line=line,
            code="OLP521",
            missing=("tools", str(number)),
        )
    entry = kind == _ENTRY
    wrong = [
        a for a, mm in stated.items() if not any(abs(mm - own) < _SAME_MM for own in _own(tool, kind, a))
    ]
    if wrong or not (entry or state.absolute):
        keys = ", ".join(_entry(tool, a, stated[a]) for a in wrong) if entry else _KEYS[kind]
        raise ProgramError(
            f"G10 L{kind} writes {_WRITTEN[kind]} of tool {number} that is not the one of the machine file; "
            f"give {keys} in [tools.{number}] as the program writes it"
            + ("" if entry else ", and the program in G90")
            + (", or leave L11 out" if kind == 11 else ""),
            line=line,
            code="OLP526",
        )


def _entry(tool: Tool, letter: str, mm: float) -> str:
    """The key of the tool's table that a word writes, with the value that it writes."""
    key, value = ("radius_mm", mm - tool.wear_mm) if letter == "R" else (f"{letter}_mm", mm)
    return f"{key} = {round(value, 9):.9g}"


def _own(tool: Tool, kind: int, letter: str) -> list[float]:
    """What the machine file has for a word, in mm; a radius may be stated as a diameter on ISO controls."""
    if kind == 11:
        return [0.0]
    if letter != "R" or kind == 10:
        return [tool.length_mm["XYZ".index(letter) if letter != "R" else 2]]
    radius = tool.wear_mm if kind == 13 else tool.radius_mm
    if radius is None:
        return []
    return [radius + tool.wear_mm] if kind == _ENTRY else [radius, 2.0 * radius]
