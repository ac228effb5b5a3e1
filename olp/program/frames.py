"""Named frames and tools with their tool vectors, as frames of a toolpath: shared by all readers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector, WorkOffset
from olp.core.toolpath import CutterCompensation, Frame, Touch, carried

Turn = tuple[Vector, Vector, Vector]

UP: Vector = (0.0, 0.0, 1.0)
#: A direction is an axis of the machine where its other components are below this.
ALONG = 1e-7


def turn_of(angles_deg: Vector) -> Turn | None:
    """The rows of Rz(C) Ry(B) Rx(A); None where nothing turns."""
    if not any(angles_deg):
        return None
    (ca, cb, cc), (sa, sb, sc) = np.cos(np.radians(angles_deg)), np.sin(np.radians(angles_deg))
    rows = (
        (cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa),
        (sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa),
        (-sb, cb * sa, cb * ca),
    )
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in rows)
    return (a, b, c)


def turned(turn: Turn | None, vector: Vector) -> Vector:
    """A direction of a frame, in machine coordinates."""
    if turn is None:
        return vector
    x, y, z = (sum(r * v for r, v in zip(row, vector, strict=True)) for row in turn)
    return (x, y, z)


def tool_vector_of(setup: Setup, number: int, line: int) -> Vector:
    """Gauge point to tip of a tool. Raises ProgramError where it is not defined."""
    tool = setup.tool(number)
    if tool is None:
        raise ProgramError(
            f"tool {number} is in the spindle but not defined; give [tools.{number}] in the machine or "
            "job file",
            line=line,
        )
    tool_vector = tool.tool_vector_mm
    if tool_vector is None:
        raise ProgramError(
            f"tool {number} has Z_mm = {tool.length_mm[2]:g}, which is a touch-off value and not a length; "
            f"give tools.{number}.gauge_to_tip_mm",
            line=line,
        )
    return tool_vector


def touch_of(setup: Setup, work: WorkOffset, line: int | None) -> Touch | None:
    """Where a work offset was touched off on the uncompensated machine: axis position, tool vector, payload;
    None where it was located by other means."""
    if work.set_by == "true":
        return None
    length = tool_vector = ZERO
    if work.touch_tool is not None:
        tool = setup.tool(work.touch_tool)
        if tool is None or tool.tool_vector_mm is None:
            raise ProgramError(
                f"work offset {work.name} was touched off with tool {work.touch_tool}, "
                "whose tool vector is not defined; give its Z_mm or gauge_to_tip_mm",
                line=line,
            )
        length, tool_vector = tool.length_mm, tool.tool_vector_mm
    axis_mm = [
        work.offset_mm[i] + length[i] if stated is None else stated
        for i, stated in enumerate(work.touched_at_mm)
    ]
    payload = setup.job.payload_kg if work.touched_payload_kg is None else work.touched_payload_kg
    return (axis_mm[0], axis_mm[1], axis_mm[2]), carried(tool_vector, payload)


class FrameTable:
    """Frames of one program: each is made once, where it is first used."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.frames: list[Frame] = []
        self._index: dict[Frame, int] = {}

    def work_offset(self, name: str, line: int, what: str) -> WorkOffset:
        """A frame of machine or job by its name. Raises ProgramError where there is none."""
        work = self.setup.work_offset(name)
        if work is None:
            raise ProgramError(
                f"{what} needs the frame {name}, which is not defined; give [work_offsets.{name}] in the job "
                "file: X_mm, Y_mm, Z_mm and, where it is turned, A_deg, B_deg, C_deg",
                line=line,
            )
        return work

    def index(
        self,
        work: WorkOffset,
        line: int,
        *,
        unit_mm: float,
        tool: int | None = None,
        length: Vector = ZERO,
        tool_vector: Vector = ZERO,
        axis: Vector = UP,
        tool_touched: Touch | None = None,
        compensation: CutterCompensation | None = None,
    ) -> int:
        """The number of a frame: a work offset, and a tool that points along `axis`, a direction of the
        machine from tip to gauge point. Raises ProgramError for a tilted tool with X or Y in its vector."""
        if axis != UP:
            length, tool_vector = (_tilted(v, axis, tool, line) for v in (length, tool_vector))
        x, y, z = (o + n for o, n in zip(work.offset_mm, length, strict=True))
        frame = Frame(
            unit_mm=unit_mm, offset_mm=(x, y, z), length_mm=length, tool_mm=tool_vector, tool=tool,
            work_offset=work.name, touched=touch_of(self.setup, work, line), tool_touched=tool_touched,
            turn=turn_of(work.rotation_deg), payload_kg=self.setup.job.payload_kg, compensation=compensation,
        )  # fmt: skip
        return self._known(frame)

    def lifted(self, number: int, lift: Vector) -> int:
        """A frame in which the tip keeps this distance from the stated points."""
        frame = self.frames[number]
        x, y, z = (o + v for o, v in zip(frame.offset_mm, lift, strict=True))
        return self._known(replace(frame, offset_mm=(x, y, z), lift_mm=lift))

    def _known(self, frame: Frame) -> int:
        known = self._index.get(frame)
        if known is None:
            known = self._index[frame] = len(self.frames)
            self.frames.append(frame)
        return known


def _tilted(vector: Vector, axis: Vector, tool: int | None, line: int) -> Vector:
    if vector[0] or vector[1]:
        raise ProgramError(
            f"tool {tool} is tilted and its vector has X or Y, and how the head turns these is not known; "
            "give its X and Y as 0",
            line=line,
        )
    x, y, z = (vector[2] * a for a in axis)
    return (x, y, z)
