"""The frame of positions in a named work offset with a tool; an error where either is not defined."""

from __future__ import annotations

from olp.core.machine import ZERO, Setup
from olp.program.frames import FrameTable, tool_vector_of


def frame_index(
    table: FrameTable, setup: Setup, name: str, tool: int | None, unit_mm: float, line: int
) -> int:
    """The number of the frame; `tool` None is the one in the spindle at the start. Raises ProgramError where
    the work offset or the tool is not defined."""
    work = table.work_offset(name, line, "this position")
    number = setup.machine.default_tool if tool is None else tool
    length = tool_vector = ZERO
    if number:
        tool_vector = tool_vector_of(setup, number, line)
        entry = setup.tool(number)
        if entry is not None and setup.machine.length_active:
            length = entry.length_mm
    return table.index(
        work, line, unit_mm=unit_mm, tool=number or None, length=length, tool_vector=tool_vector,
        length_active=setup.machine.length_active,
    )  # fmt: skip
