"""What the statements of Sinumerik programs do to the state: frames, tools, offsets, path modes.

Sources: Siemens, Programming Manual Fundamentals (frames, tool offsets, path modes).
"""

from __future__ import annotations

import numpy as np

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Vector
from olp.core.turns import Turn, rows_of
from olp.core.values import dataclass
from olp.program.rs274.axis_state import AxisState
from olp.program.rs274.codes import COMPENSATION_LEFT
from olp.program.rs274.cutter import switched_on
from olp.program.rs274.offsets import Transform
from olp.program.rs274.state import PathMode
from olp.program.rs274.translation import Action


@dataclass(frozen=True, slots=True)
class SelectOffset(Action):
    """A settable offset by its name: G505 to G599, and G500, which is none."""

    name: str

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a change of offsets is", line)
        state.offsets.name = self.name
        if self.name == NO_OFFSET and state.setup.work_offset(self.name) is None:
            state.offsets.written.setdefault(self.name, [0.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class WriteOffset(Action):
    """$P_UIFR: a settable offset by its name, in mm; values of axes that stay as they are are None."""

    name: str
    values_mm: tuple[float | None, float | None, float | None]

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a change of offsets is", line)
        if state.offsets.name == self.name and state.last_frame >= 0:
            raise ProgramError(
                f"{self.name} is in force while the program writes it, and counts from the next {self.name} "
                "on only; program G500 before it",
                line=line,
                code="OLP518",
            )
        if state.unit_mm != 1.0:
            raise ProgramError(
                "$P_UIFR is written in inches, and machine data say in which unit it counts; give G71",
                line=line,
                code="OLP518",
            )
        work = state.setup.work_offset(self.name)
        before = state.offsets.written.get(self.name) or (None if work is None else work.offset_mm)
        if before is None and None in self.values_mm:
            raise ProgramError(
                f"$P_UIFR changes one axis of {self.name}, which is not defined; give "
                f"[work_offsets.{self.name}] in the machine or job file",
                line=line,
                code="OLP520",
                missing=("work_offsets", self.name),
            )
        old = before or ZERO
        state.offsets.written[self.name] = [
            o if v is None else v for v, o in zip(self.values_mm, old, strict=True)
        ]


#: G17, as ten times its number.
_XY = 170
#: G500, in which no settable offset counts.
NO_OFFSET = "G500"


@dataclass(frozen=True, slots=True)
class SetUnit(Action):
    """Lengths in G20 or G21 of this family, whatever the unit of feeds."""

    code: int

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a change of units is", line)
        state.unit = self.code


@dataclass(frozen=True, slots=True)
class ChangeFrame(Action):
    """TRANS, ROT, SCALE and MIRROR, which replace the programmable frame, or add to it: a point w of the
    program becomes `turn` w + `shift`, in program units. `in_plane`: it turns in the plane that is active."""

    shift: Vector = ZERO
    turn: Turn | None = None
    adds: bool = False
    in_plane: bool = False

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a change of the frame is", line)
        if self.in_plane and state.plane != _XY:
            raise ProgramError(
                "RPL outside of G17 tilts the plane, which is not read; post the operation for three axes",
                line=line,
                code="OLP512",
            )
        offsets = state.offsets
        matrix, base = np.eye(3), np.zeros(3)
        if self.adds:
            base = np.array(offsets.local)
            if offsets.transform is not None:
                matrix = np.array(offsets.transform.turn)
        base = base + matrix @ (np.array(self.shift) * state.unit_mm)
        if self.turn is not None:
            matrix = matrix @ np.array(self.turn)
        offsets.local = base.tolist()
        identical = bool((matrix == np.eye(3)).all())
        offsets.transform = None if identical else Transform(0, rows_of(matrix), ZERO, (0, 1, 2))


@dataclass(frozen=True, slots=True)
class NameTool(Action):
    """T="NAME": the tool that comes next."""

    name: str

    def run(self, state: AxisState, line: int) -> None:
        tools = {**state.setup.machine.tools, **state.setup.job.tools}
        numbers = [number for number, tool in tools.items() if tool.name == self.name]
        if self.name.isdigit() and not numbers:
            numbers = [int(self.name)]
        if len(numbers) != 1:
            raise ProgramError(
                f'T="{self.name}" is the name of {len(numbers)} tools; give name = "{self.name}" in the '
                "table [tools.NUMBER] of one tool, in the machine or job file, with a number of your choice",
                line=line,
                code="OLP521",
            )
        state.selected = numbers[0]


@dataclass(frozen=True, slots=True)
class ChangeTool(Action):
    """M6: the next tool is in the spindle, and its first edge counts."""

    def moves(self, state: AxisState) -> bool:
        return bool(state.setup.machine.tool_change_moves)

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a tool change is", line)
        if state.selected is None:
            raise ProgramError(
                "M6 changes to a tool, but no T word comes before it; give T", line=line, code="OLP516"
            )
        state.spindle = state.selected
        if self.moves(state):
            state.forget()
        Edge(1).run(state, line)


@dataclass(frozen=True, slots=True)
class Edge(Action):
    """D: the length of an edge of the tool in the spindle counts; D0: none does."""

    number: int

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "another edge is", line)
        offsets = state.offsets
        if self.number == 0:
            if offsets.tip:
                raise ProgramError(
                    "D0 comes behind TRAORI, so words do not state the tip of the tool; program TRAFOOF "
                    "before it",
                    line=line,
                    code="OLP518",
                )
            offsets.length, state.length_tool = ZERO, None
            return
        if self.number > 1:
            raise ProgramError(
                f"D{self.number} is another edge of the tool, and the tool table of olp has one for each; "
                "program D1, or give the edge a tool number of its own",
                line=line,
                code="OLP521",
            )
        tool = state.spindle if state.spindle is not None else state.selected
        if tool is None:
            raise ProgramError(
                "D1 takes the length of the tool in the spindle, which is not known; give T and M6 before "
                "it, or `tool` in the job file",
                line=line,
                code="OLP532",
            )
        if state.spindle is None:
            state.spindle = tool
        # a tip has no length
        offsets.length = ZERO if offsets.tip else _length(state, tool, line)
        state.length_tool = tool or None


@dataclass(frozen=True, slots=True)
class Compensate(Action):
    """G41 or G42, as ten times its number, with the radius of the edge in force. `ways` are modes in which
    the path of the tool is not known."""

    code: int
    ways: tuple[str, ...] = ()

    def run(self, state: AxisState, line: int) -> None:
        if self.ways:
            raise ProgramError(
                f"G{self.code // 10} comes with {', '.join(self.ways)}, and the tool's path is known with "
                "NORM, G450, DISC=0 and G460 only; program these, or post the path of the tool",
                line=line,
                code="OLP518",
            )
        if state.length_tool is None:
            raise ProgramError(
                f"G{self.code // 10} takes the radius of the edge in force, and none is; give D1 before it",
                line=line,
                code="OLP532",
            )
        if state.compensation is not None and state.compensation.left == (self.code in COMPENSATION_LEFT):
            return
        state.compensation = switched_on(state, self.code, line, {})


@dataclass(frozen=True, slots=True)
class GoHome(Action):
    """G74 and G75: the control moves these axes to a point of its own."""

    def moves(self, state: AxisState) -> bool:
        return True

    axes: tuple[int, ...]

    def run(self, state: AxisState, line: int) -> None:
        outside_contours(state, "a move of the control's own is", line)
        state.forget(self.axes)


@dataclass(frozen=True, slots=True)
class Tolerate(Action):
    """CYCLE832 and ADIS: how far the control may leave the path."""

    name: str
    tolerance: float

    def run(self, state: AxisState, line: int) -> None:
        state.path_modes.append(PathMode(line, "G64", self.tolerance * state.unit_mm))


def outside_contours(state: AxisState, what: str, line: int) -> None:
    """Refuse what changes in the midst of a contour under cutter compensation."""
    if state.compensation is not None:
        raise ProgramError(f"{what} in cutter compensation; give G40 before", line=line, code="OLP518")


def _length(state: AxisState, number: int, line: int) -> Vector:
    tool = state.setup.tool(number)
    if tool is None and number:
        raise ProgramError(
            f"the length of tool {number} counts here, and the tool is not defined; give [tools.{number}] in "
            "the machine or job file",
            line=line,
            code="OLP521",
            missing=("tools", str(number)),
        )
    return ZERO if tool is None else tool.length_mm
