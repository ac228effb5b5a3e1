"""Frames of programs that name work offsets and tools: refused where they are not defined."""

from __future__ import annotations

from olp.exceptions import ProgramError
from olp.machine import ZERO, Setup, Vector, WorkOffset
from olp.toolpath import Frame


def frame_of(setup: Setup, name: str, tool: int | None, unit_mm: float, line: int) -> Frame:
    """The frame of positions in a work offset with a tool (None: the one in the spindle at the start).

    Raises ProgramError: a frame or tool that is not defined is never taken for the identity.
    """
    work = setup.work_offset(name)
    if work is None:
        raise ProgramError(
            f'the frame {name} is used but not defined; give [work_offsets."{name}"] in the machine or job '
            "file",
            line=line,
        )
    if any(work.rotation_deg):
        raise ProgramError(
            f"work offset {name} is rotated, which is not read yet in this dialect; state it with A_deg = "
            "B_deg = C_deg = 0",
            line=line,
        )
    number = setup.machine.default_tool if tool is None else tool
    length, lever = ZERO, ZERO
    if number:
        found = setup.tool(number)
        if found is None or found.lever_mm is None:
            raise ProgramError(
                f"tool {number} is used but its lever is not defined; give [tools.{number}] with Z_mm or "
                "gauge_to_tip_mm in the machine or job file",
                line=line,
            )
        lever = found.lever_mm
        length = found.length_mm if setup.machine.length_active else ZERO
    x, y, z = (o + n for o, n in zip(work.offset_mm, length, strict=True))
    return Frame(
        unit_mm=unit_mm, offset_mm=(x, y, z), length_mm=length, tool_mm=lever, tool=number or None,
        work_offset=name, touched=touched(setup, work, line),
    )  # fmt: skip


def touched(setup: Setup, work: WorkOffset, line: int | None = None) -> tuple[Vector, Vector] | None:
    """Axis position and lever at the touch that set a zero on the raw machine, None where it was set by other
    means."""
    if work.set_by == "true":
        return None
    length = lever = ZERO
    if work.touch_tool is not None:
        tool = setup.tool(work.touch_tool)
        if tool is None or tool.lever_mm is None:
            raise ProgramError(
                f"work offset {work.name} was touched off with tool {work.touch_tool}, whose lever is not "
                "defined; give its Z_mm or gauge_to_tip_mm",
                line=line,
            )
        length, lever = tool.length_mm, tool.lever_mm
    x, y, z = (work.offset_mm[i] + length[i] if at is None else at for i, at in enumerate(work.touched_at_mm))
    return (x, y, z), lever
