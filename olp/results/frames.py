"""Frames and styli of a job, by the names that a file of reported points gives them."""

from __future__ import annotations

import numpy as np

from olp.core.errors import ConfigError, InputError
from olp.core.geometry import rotation_matrix
from olp.core.machine import ZERO, Setup, Tool
from olp.program.frames import touch_of
from olp.results.forward import ReportFrame, Stylus

#: the frame whose points are axis positions
MACHINE = "machine"


def frame_of(setup: Setup, name: str | None) -> ReportFrame:
    """The frame with a name. Raises InputError where the file names none, ConfigError where nothing defines
    it."""
    if name is None:
        raise InputError(
            "states no frame, so the position of its points on the machine is not known; "
            "name one of [work_offsets] with --frame, or give --frame machine for axis positions"
        )
    if name == MACHINE:
        return ReportFrame(MACHINE, np.eye(3), ZERO, None)
    known = (*setup.job.work_offsets, *setup.machine.work_offsets)
    # DMIS does not distinguish capital and small letters in labels
    meant = name if name in known else next((n for n in known if n.upper() == name.upper()), name)
    work = setup.work_offset(meant)
    if work is None:
        raise ConfigError(
            f'frame {name} is not defined; give [work_offsets."{name}"] in the job file, '
            "with X_mm, Y_mm, Z_mm and A_deg, B_deg, C_deg of the part"
        )
    return ReportFrame(name, rotation_matrix(work.rotation_deg), work.offset_mm, touch_of(setup, work, None))


def stylus_of(setup: Setup, label: str | int | None, by_row: bool) -> Stylus:
    """The stylus that a file calls `label`: one of [styli] or the number of a tool; None is the tool in the
    spindle at the start. With `by_row` the rows state their vectors, and a tool only gives the radius. Raises
    ConfigError."""
    usual = setup.tool(setup.machine.default_tool) if setup.machine.default_tool else None
    tool_vector = setup.stylus(str(label)) if label is not None else None
    if tool_vector is not None:
        x, y, z = tool_vector
        return Stylus((0.0 - x, 0.0 - y, 0.0 - z), tool_vector, (usual.radius_mm or 0.0) if usual else 0.0)
    number = setup.machine.default_tool if label is None else label
    if number is None and by_row:
        return Stylus(ZERO, ZERO, 0.0)
    if number is None:
        raise ConfigError(
            "no stylus is known, and angular errors act through its vector; give job_defaults.tool in the "
            "machine file, --tool, or columns SX, SY, SZ (gauge point to tip)"
        )
    if isinstance(number, str) and number.isdigit():
        number = int(number)
    if number == 0:
        return Stylus(ZERO, ZERO, 0.0)
    tool: Tool | None = setup.tool(number) if isinstance(number, int) else None
    if tool is None:
        raise ConfigError(
            f'stylus {number} is not defined; give [styli."{number}"] offset_mm = [x, y, z] in the machine '
            "or job file, end of the ram to centre of the tip, or the number of a tool with --tool"
        )
    if tool.tool_vector_mm is None and not by_row:
        raise ConfigError(f"stylus {number} has no tool vector; give tools.{number}.Z_mm or gauge_to_tip_mm")
    return Stylus(tool.length_mm, tool.tool_vector_mm or ZERO, tool.radius_mm or 0.0)
