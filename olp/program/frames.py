"""Named frames and tools with their tool vectors, as frames of a toolpath: shared by all readers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import ZERO, Setup, Vector, WorkOffset
from olp.core.toolpath import CutterCompensation, Frame, Interpolated, LengthError, Touch, carried
from olp.core.turns import Turn
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass

UP: Vector = (0.0, 0.0, 1.0)
DOWN: Vector = (0.0, 0.0, -1.0)


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


def product(outer: Turn | None, inner: Turn | None) -> Turn | None:
    """The rows of one rotation after another, `inner` first."""
    if outer is None or inner is None:
        return outer if inner is None else inner
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in (np.array(outer) @ np.array(inner)).tolist())
    return (a, b, c)


@dataclass(frozen=True, slots=True)
class Placement:
    """Where points of a program lie in its work offset: `turn` p + `shift_mm`; `turn` is None where nothing
    turns."""

    turn: Turn | None
    shift_mm: Vector


def tool_vector_of(setup: Setup, number: int, line: int) -> Vector:
    """Gauge point to tip of a tool. Raises ProgramError where it is not defined."""
    tool = setup.tool(number)
    if tool is None:
        raise ProgramError(
            f"tool {number} is in the spindle but not defined; give [tools.{number}] in the machine or "
            "job file",
            line=line,
            code="OLP521",
            missing=("tools", str(number)),
        )
    tool_vector = tool.tool_vector_mm
    if tool_vector is None:
        raise ProgramError(
            f"tool {number} has Z_mm = {tool.length_mm[2]:g}, which is a touch-off value and not a length; "
            f"give tools.{number}.gauge_to_tip_mm",
            line=line,
            code="OLP521",
            missing=("tools", str(number)),
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
                code="OLP521",
                missing=("tools", str(work.touch_tool)),
            )
        length, tool_vector = tool.length_mm, tool.tool_vector_mm
    axis_mm = [
        work.offset_mm[i] + length[i] if stated is None else stated
        for i, stated in enumerate(work.touched_at_mm)
    ]
    payload = setup.job.payload_kg if work.touched_payload_kg is None else work.touched_payload_kg
    return (axis_mm[0], axis_mm[1], axis_mm[2]), carried(tool_vector, payload)


def touch_tool_of(work: WorkOffset) -> int | None:
    """The tool whose length is in a work offset; None where it was located by other means or without a
    tool."""
    return work.touch_tool if work.set_by == "touch" else None


@dataclass(frozen=True, slots=True)
class _Setting:
    """How the length of a tool was set: where on the uncompensated machine (None: not there), by which setter
    (None: its length is true), and the constant of the setter where it is known."""

    number: int
    touched: Touch | None
    setter: str | None
    constant_mm: float | None


def length_errors_of(
    setup: Setup, cutting: int, touching: int | None, axis: Vector = UP
) -> tuple[LengthError, ...]:
    """The errors of stored lengths between a cut with tool `cutting`, its length active and pointing along
    `axis` from tip to gauge point, and a work offset that tool `touching` touched along Z. None of them where
    one tool does both. `touching` None: the offset has no tool length in it.

    Raises ConfigError where the constant of a setter does not cancel and is not stated.
    """
    if cutting == touching and axis == UP:
        return ()
    cut = _setting(setup, cutting)
    base = None if touching is None else _setting(setup, touching)
    cancels = base is not None and cut.setter == base.setter and axis == UP
    parts = [(cut, axis)] + ([] if base is None else [(base, DOWN)])
    errors = []
    for setting, along in parts:
        constant_mm = 0.0 if cancels or setting.setter is None else setting.constant_mm
        if constant_mm is None:
            raise ConfigError(_unknown_constant(setting, cut, base, axis))
        if setting.touched is not None or constant_mm:
            errors.append(LengthError(along, setting.touched, constant_mm))
    return tuple(errors)


def _setting(setup: Setup, number: int) -> _Setting:
    tool = setup.tool(number)
    if tool is None or (tool.set_by == "true" and tool.setter is None):
        return _Setting(number, None, None, None)
    setter = tool.setter or ""
    touched = None
    if tool.set_by == "touch" and tool.touched_at_mm is not None:
        if tool.gauge_to_tip_mm is None and tool.length_mm[2] <= 0.0:
            raise ConfigError(
                f"tools.{number}.Z_mm = {tool.length_mm[2]:g} is relative to another tool and no length; "
                f"give tools.{number}.gauge_to_tip_mm"
            )
        assert tool.tool_vector_mm is not None
        touched = tool.touched_at_mm, carried(tool.tool_vector_mm, setup.job.payload_kg)
    return _Setting(number, touched, setter, _constant_mm(setup, setter))


def _constant_mm(setup: Setup, setter: str) -> float | None:
    """The constant that any tool of a setter states, in mm. Raises ConfigError where two of them differ."""
    tools = {**setup.machine.tools, **setup.job.tools}.values()
    stated = [
        (t.constant_mm, t.number) for t in tools if (t.setter or "") == setter and t.constant_mm is not None
    ]
    if not stated:
        return None
    (least, a), (most, b) = min(stated), max(stated)
    if least != most:
        raise ConfigError(
            f"tools.{a}.k_um = {least * UM_PER_MM:g} and tools.{b}.k_um = {most * UM_PER_MM:g} are of one "
            "setter; expected one constant, or the key setter in both"
        )
    return least


def _unknown_constant(setting: _Setting, cut: _Setting, base: _Setting | None, axis: Vector) -> str:
    """Why the constant of a setter is needed, and what to do."""
    if base is None:
        why = f"the work offset was not touched off with a tool, and tool {cut.number} cuts"
        way = "name the tool that touched in touch_tool of the work offset, or give"
    elif axis != UP:
        why = f"tool {cut.number} is tilted, and tool {base.number} touched the work offset along Z"
        way = "give"
    else:
        why = f"tool {base.number} touched the work offset, and tool {cut.number} with another setter cuts"
        way = "set both lengths on one setter, or give"
    return (
        f"tools.{setting.number}: {why}, so the constant of its setter counts and is not known; {way} "
        f"tools.{setting.number}.k_um, from a master of known length"
    )


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
                code="OLP520",
                missing=("work_offsets", name),
            )
        return work

    def index(
        self,
        work: WorkOffset,
        line: int,
        *,
        inner: Placement | None = None,
        unit_mm: float,
        tool: int | None = None,
        length: Vector = ZERO,
        tool_vector: Vector = ZERO,
        axis: Vector = UP,
        length_active: bool = False,
        compensation: CutterCompensation | None = None,
    ) -> int:
        """The number of a frame: a work offset, and a tool that points along `axis`, a direction of the
        machine from tip to gauge point. `inner` places the points of the program in the work offset. Raises
        ProgramError for a tilted tool with X or Y in its vector, and ConfigError where the constant of a
        setter of lengths is not known."""
        if axis != UP:
            length, tool_vector = (_tilted(v, axis, tool, line) for v in (length, tool_vector))
        turn, offset = turn_of(work.rotation_deg), work.offset_mm
        if inner is not None:
            shift = turned(turn, inner.shift_mm)
            turn = product(turn, inner.turn)
            offset = (offset[0] + shift[0], offset[1] + shift[1], offset[2] + shift[2])
        x, y, z = (o + n for o, n in zip(offset, length, strict=True))
        lengths: tuple[LengthError, ...] = ()
        if length_active and tool is not None:
            lengths = length_errors_of(self.setup, tool, touch_tool_of(work), axis)
        frame = Frame(
            unit_mm=unit_mm, offset_mm=(x, y, z), length_mm=length, tool_mm=tool_vector, tool=tool,
            work_offset=work.name, touched=touch_of(self.setup, work, line), lengths=lengths,
            turn=turn, payload_kg=self.setup.job.payload_kg, compensation=compensation,
        )  # fmt: skip
        return self._known(frame)

    def lifted(self, number: int, lift: Vector) -> int:
        """A frame in which the tip keeps this distance from the stated points."""
        frame = self.frames[number]
        x, y, z = (o + v for o, v in zip(frame.offset_mm, lift, strict=True))
        return self._known(replace(frame, offset_mm=(x, y, z), lift_mm=lift))

    def moved(self, number: int, shift: Vector) -> int:
        """A frame whose origin is moved by this much, as by a datum shift."""
        frame = self.frames[number]
        x, y, z = (o + v for o, v in zip(frame.offset_mm, shift, strict=True))
        return self._known(replace(frame, offset_mm=(x, y, z)))

    def tipped(self, number: int, tip: Interpolated) -> int:
        """A frame whose words state the tip of the tool (`Frame.tip`)."""
        return self._known(replace(self.frames[number], tip=tip))

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
            code="OLP523",
        )
    x, y, z = (vector[2] * a for a in axis)
    return (x, y, z)
