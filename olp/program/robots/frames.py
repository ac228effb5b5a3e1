"""Frames and tools of robot programs: from the program, or from the machine and job file, never assumed.

A target states the tool tip in a frame. Frames of a program are stated in the world of the robot, which is
the machine's own frame unless the job states where it lies.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector, WorkOffset
from olp.core.machine import Tool as Entry
from olp.core.values import dataclass
from olp.program.frames import FrameTable, Placement, tool_vector_of
from olp.program.robots.poses import Pose, Quaternion, inverted, multiplied, of_zyx, rotated, turn_of

#: How different two tool vectors may be to be the same, mm.
_SAME_TOOL_MM = 1e-6


@dataclass(frozen=True, slots=True)
class Located:
    """A frame: its `pose` in machine coordinates, and where it is in the work offset `work` of machine or
    job, None where these state none."""

    name: str
    pose: Pose
    inner: Pose
    work: WorkOffset | None = None

    def holding(self, name: str, inner: Pose) -> Located:
        """A frame that is stated in this one."""
        return Located(name, self.pose.then(inner), self.inner.then(inner), self.work)


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool: the pose of its tip at the flange, or the `vector_mm` from gauge point to tip where machine or
    job state it, and the number that it has there."""

    name: str
    pose: Pose | None
    vector_mm: Vector = ZERO
    number: int | None = None


class RobotFrames:
    """The frames of one program, whose positions are in units of `unit_mm`. `world` is the name of the
    robot's world."""

    def __init__(self, setup: Setup, world: str, unit_mm: float = 1.0) -> None:
        self.setup, self.unit_mm = setup, unit_mm
        self.table = FrameTable(setup)
        work = self._work(world)
        self.world = Located(world, Pose() if work is None else _pose(work), Pose(), work)

    def located(self, name: str, stated: Pose | None, line: int) -> Located:
        """A frame by its name; `stated` is what the program says of it. Raises ProgramError where nothing
        does, or two say something different."""
        if name.casefold() == self.world.name.casefold():
            return self.world
        work = self._work(name)
        own = None if stated is None else self.world.pose.then(stated)
        if work is None:
            if own is None:
                self.table.work_offset(name, line, "this target")
            assert own is not None
            assert stated is not None
            return Located(name, own, stated, self.world.work)
        if own is not None and not own.same(_pose(work)):
            raise ProgramError(
                f"the frame {name} is stated by the program and by [work_offsets.{work.name}], and they "
                "differ; state it once, or the same",
                line=line,
                code="OLP523",
            )
        return Located(name, _pose(work), Pose(), work)

    def tool(self, name: str, stated: Pose | None, line: int) -> Tool:
        """A tool by its name; as `located`."""
        number = self.setup.tool_named(name)
        entry = None if number is None else self.setup.tool(number)
        if self.setup.machine.arm and (entry is not None or stated is not None):
            return _at_flange(name, entry, stated, line)
        vector = None if entry is None else entry.tool_vector_mm
        if stated is None and vector is None:
            raise ProgramError(
                f"the program does not state the tool {name}; give [tools.N] in the machine or job file with "
                f'name = "{name}" and gauge_to_tip_mm',
                line=line,
                code="OLP521",
            )
        return Tool(name, stated, vector or ZERO, number if vector is not None else None)

    def numbered_tool(
        self, name: str, number: int, stated: Pose | None, line: int, *, none: int | None = 0
    ) -> Tool:
        """A tool by its number, `none` that of no tool; as `located`."""
        if self.setup.machine.arm and number != none:
            if stated is None:
                tool_vector_of(self.setup, number, line)
            return _at_flange(name, self.setup.tool(number), stated, line)
        if number != none and stated is None:
            return Tool(name, None, tool_vector_of(self.setup, number, line), number)
        entry = None if number == none else self.setup.tool(number)
        vector = None if entry is None else entry.tool_vector_mm
        own = stated or Pose()
        return Tool(name, own, vector or own.origin_mm, number if vector else None)

    def index(self, frame: Located, tool: Tool, turn: Quaternion, shift_mm: Vector, line: int) -> int:
        """The number of the frame of a target: its orientation is `turn`, and the move goes `shift_mm` from
        it along the frame."""
        vector = self._vector(frame, tool, turn, line)
        length = ZERO
        if self.setup.machine.length_active:
            length = (-vector[0], -vector[1], -vector[2])
        x, y, z = rotated(frame.inner.turn, shift_mm)
        a, b, c = frame.inner.origin_mm
        inner = Placement(turn_of(frame.inner.turn), (a + x, b + y, c + z))
        work = frame.work or WorkOffset(frame.name, set_by="true")
        return self.table.index(
            work, line, inner=inner, unit_mm=self.unit_mm, length=length, tool_vector=vector
        )

    def _vector(self, frame: Located, tool: Tool, turn: Quaternion, line: int) -> Vector:
        """Gauge point to tip in machine coordinates."""
        world = multiplied(frame.pose.turn, turn)
        if tool.pose is None:
            return tool.vector_mm
        flange = multiplied(world, inverted(tool.pose.turn))
        vector = rotated(flange, tool.pose.origin_mm)
        if tool.number is not None:
            away = max(abs(a - b) for a, b in zip(vector, tool.vector_mm, strict=True))
            if away > _SAME_TOOL_MM:
                raise ProgramError(
                    f"the tool {tool.name} is stated by the program and by [tools.{tool.number}], and they "
                    f"differ by {away:.6g} mm at this orientation; state it once, or the same",
                    line=line,
                    code="OLP521",
                )
        return vector

    def _work(self, name: str) -> WorkOffset | None:
        """The work offset of this name, in any case of letters."""
        wanted = name.casefold()
        both = {**self.setup.machine.work_offsets, **self.setup.job.work_offsets}
        return next((work for key, work in both.items() if key.casefold() == wanted), None)


def _at_flange(name: str, entry: Entry | None, stated: Pose | None, line: int) -> Tool:
    """A tool of an arm: a frame of its own at the flange. Its pose is None where its directions are stated
    nowhere. Raises ProgramError where program and job state it, and differ."""
    vector = None if entry is None else entry.tool_vector_mm
    own = None
    if entry is not None and vector is not None and entry.gauge_to_tip_deg is not None:
        a, b, c = entry.gauge_to_tip_deg
        own = Pose(vector, of_zyx((c, b, a)))
    if entry is not None and vector is not None and stated is not None:
        other = own or Pose(vector, stated.turn)
        if not stated.same(other):
            raise ProgramError(
                f"the tool {name} is stated by the program and by [tools.{entry.number}], and they differ; "
                "state it once, or the same",
                line=line,
                code="OLP521",
            )
    return Tool(name, stated or own, vector or ZERO)


def _pose(work: WorkOffset) -> Pose:
    a, b, c = work.rotation_deg
    return Pose(work.offset_mm, of_zyx((c, b, a)))
