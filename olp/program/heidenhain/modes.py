"""The running state of the reading of a Heidenhain program: presets, shifts, tools, parameters, frames."""

from __future__ import annotations

import re
from collections.abc import Sequence

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector
from olp.core.toolpath import Frame, Interpolated
from olp.core.units import MM_PER_INCH
from olp.program.frames import FrameTable, Placement, tool_vector_of, turned
from olp.program.heidenhain.planes import Plane
from olp.program.heidenhain.statements import CycleText, Statement
from olp.program.heidenhain.table import UNROLL
from olp.program.rs274.turned import Along, Turning, along_words

NAN = float("nan")
TOOL_CALL = re.compile(
    rb'TOOL[ \t]+CALL(?:[ \t]*(?:"(?P<name>[^"]*)"|(?P<number>\d+)\b(?![.\d]))?)(?P<rest>.*)', re.I | re.S
)
_DELTA = re.compile(rb"\bDL[ \t]*=?[ \t]*([-+]?(?:\d+\.?\d*|\.\d+|Q\w*))", re.I)
#: What makes the tool of a call larger or smaller than that of its table.
_OVERSIZE = re.compile(rb"\bD(?:L|R2?)[ \t]*[=:]?[ \t]*[-+]?[ \t]*(?:\d+\.?\d*|\.\d+|Q\w*)", re.I)
_OTHER_THAN_ZERO = re.compile(rb"[1-9Q]", re.I)
_AXIS = re.compile(rb"^[ \t]*([XYZUVW])\b", re.I)
#: a Heidenhain control counts feeds of inch programs in tenths of an inch
_INCH_FEED = MM_PER_INCH / 10.0


class Modes:
    """State from statement to statement; positions are axis positions in mm, NaN where not known."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.table = FrameTable(setup)
        self.position = [NAN if p is None else p for p in setup.job.start_mm]
        self.unit_mm = 1.0
        self.unit_stated = False
        self.tool = setup.machine.default_tool
        self.length_active = setup.machine.length_active and self.tool is not None
        self.delta_mm = 0.0
        #: whether DL, DR or DR2 of the last call are not 0
        self.oversize = False
        #: the datum shift along the words, and in a tilted plane also the one below it
        self.shift: Vector = ZERO
        self.below: Vector = ZERO
        #: the tilted plane in force, and the last one that was stated
        self.plane: Plane | None = None
        self.stated_plane: Plane | None = None
        #: the line of the last PLANE
        self.tilted_line = 0
        #: axes whose datum shift is not known: it was changed while one below a tilted plane was in force
        self.unclear: set[int] = set()
        #: axes whose shift was set to 0 in the plane in force: all three cancel the one below it, too
        self.cancelled: set[int] = set()
        self.preset = setup.machine.default_work_offset
        self.selected: tuple[int, str] | None = None
        #: parameters with known numbers
        self.parameters: dict[str, float] = {}
        self.remarks: dict[str, tuple[int, str]] = {}
        #: tool centre point control, as in `Frame`
        self.tip: Interpolated = ""
        #: the position along the words of a tilted plane
        self.along = Along()
        self._frame: int | None = None

    @property
    def feed_scale(self) -> float:
        """mm/s of a feed of 1."""
        return (1.0 if self.unit_mm == 1.0 else _INCH_FEED) / 60.0

    def changed(self) -> None:
        """Forget the present frame: what it is made from has changed."""
        self._frame = None

    def words_at(self, frame: Frame) -> list[float]:
        """The position along the words of a frame, mm, with its offset."""
        if frame.tip == "fixed":
            return self.along.of(frame.turn, self.position)
        return along_words(Turning.of(frame.turn), self.position)

    def move_to(self, frame: Frame, position: Sequence[float], words: Array) -> None:
        """Take over where a move in a frame ends: the axes, and along the words."""
        self.position[:] = position
        if frame.tip == "fixed":
            self.along.put(frame.turn, self.position, words)

    def frame(self, line: int) -> int:
        """Index of the present frame. Raises ProgramError for a tool or a work offset that is not defined."""
        if self._frame is None:
            work = self.table.work_offset(self.preset, line, "the program")
            if any(work.rotation_deg):
                raise ProgramError(
                    f"work offset {work.name} is rotated, which is not read in this dialect; state it with "
                    "A_deg = B_deg = C_deg = 0",
                    line=line,
                    code="OLP523",
                )
            length = vector = ZERO
            if self.tool:
                x, y, z = tool_vector_of(self.setup, self.tool, line)
                vector = (x, y, z - self.delta_mm)
                tool = self.setup.tool(self.tool)
                assert tool is not None
                if self.length_active and not self.tip and self.plane is None:
                    length = (*tool.length_mm[:2], tool.length_mm[2] + self.delta_mm)
            index = self.table.index(
                work, line, inner=self._placement(line), unit_mm=self.unit_mm, tool=self.tool, length=length,
                tool_vector=vector, length_active=self.length_active and bool(self.tool),
            )  # fmt: skip
            tip = self.tip or ("" if self.plane is None else "fixed")
            self._frame = self.table.tipped(index, tip) if tip else index
        return self._frame

    def _placement(self, line: int) -> Placement:
        """Where words lie in the preset. Raises ProgramError where a datum shift is not known."""
        if self.unclear:
            raise ProgramError(
                "a datum shift was changed in a tilted plane while another one below the plane was in force, "
                "so it is not known; program CYCL DEF 7 with X, Y and Z behind PLANE RESET",
                line=line,
                code="OLP518",
            )
        if self.plane is None:
            return Placement(None, self.shift)
        shift = turned(self.plane.turn, self.shift)
        x, y, z = (a + b for a, b in zip(self.below, shift, strict=True))
        return Placement(self.plane.turn, (x, y, z))

    def tilt(self, plane: Plane, line: int) -> None:
        """PLANE: a shift that is in force before it acts below the plane. Raises ProgramError where no tool
        is known."""
        self.tilted_line = line
        self.along.drop()
        if plane.ends:
            if self.plane is not None:
                if len(self.cancelled) == len(ZERO):
                    self.below, self.unclear = ZERO, set()
                elif any(self.shift):
                    self.unclear = {0, 1, 2}
                self.shift, self.below = (self.below, ZERO)
            self.plane = self.stated_plane = None
            self.changed()
            return
        if self.tool is None:
            raise ProgramError(
                "words state the tip of the tool in a tilted plane, and no tool is called; give TOOL CALL "
                "before",
                line=line,
                code="OLP532",
            )
        if self.plane is None:
            self.below, self.shift = self.shift, ZERO
        elif any(self.shift):
            self.unclear = {0, 1, 2}
        self.plane = self.stated_plane = plane
        self.cancelled = set()
        self.changed()

    def switch_tips(self, tip: Interpolated, line: int) -> None:
        """M128, M129 and FUNCTION TCPM. Raises ProgramError where no tool is known."""
        if tip and self.tool is None:
            raise ProgramError(
                "words state the tip of the tool from here on, and no tool is called; give TOOL CALL before",
                line=line,
                code="OLP532",
            )
        self.tip = tip
        self.changed()

    def tool_call(self, statement: Statement) -> bool:
        """Take over a TOOL CALL; returns whether the tool is changed."""
        match = TOOL_CALL.match(statement.text)
        assert match is not None
        number = self.tool
        if match["name"] is not None:
            number = self._named(match["name"].decode("latin-1"), statement.line)
        elif match["number"] is not None:
            number = int(match["number"])
        elif re.match(rb"[ \t]*Q", match["rest"], re.I):
            raise ProgramError(
                "TOOL CALL takes the number of the tool from a parameter; state its number",
                line=statement.line,
                code="OLP511",
            )
        axis = _AXIS.match(match["rest"])
        if axis is not None and axis[1].upper() != b"Z":
            raise ProgramError(
                f"TOOL CALL has the tool along {axis[1].decode()}, which is not read; expected Z",
                line=statement.line,
                code="OLP512",
            )
        delta = _DELTA.search(match["rest"])
        changes = number != self.tool or not self.length_active
        if delta is not None or match["name"] or match["number"]:
            value = b"0" if delta is None else delta[1]
            if value.upper().startswith((b"Q", b"+Q", b"-Q")):
                raise ProgramError(
                    "TOOL CALL takes DL from a parameter; state its number",
                    line=statement.line,
                    code="OLP511",
                )
            self.delta_mm = float(value) * self.unit_mm
        stated = _OVERSIZE.findall(match["rest"])
        if stated or match["name"] or match["number"]:
            self.oversize = any(
                _OTHER_THAN_ZERO.search(re.sub(rb"(?i)^DR2", b"", text)[1:]) for text in stated
            )
        moved = number != self.tool
        self.tool, self.length_active = number, True
        if changes or delta is not None:
            self.changed()
        return moved

    def _named(self, name: str, line: int) -> int:
        number = self.setup.tool_named(name)
        if number is None:
            raise ProgramError(
                f'tool "{name}" is called but not defined; give name = "{name}" in a table [tools.N] of the '
                "machine or job file",
                line=line,
                code="OLP521",
                missing=("tool_names", name),
            )
        return number

    def select_preset(self, number: int, line: int) -> None:
        """CYCL DEF 247. A preset that is not defined by its number is that of the job, where the program has
        no other."""
        name = str(number)
        if self.setup.work_offset(name) is None:
            before = self.selected
            if before is not None and before[1] != name:
                self.table.work_offset(name, line, "CYCL DEF 247")
            self.selected = (line, name)
            self.remarks.setdefault(
                "preset",
                (line, f"preset {name} is taken as work offset {self.setup.machine.default_work_offset}"),
            )
            name = self.setup.machine.default_work_offset
        self.preset = name
        self.shift = self.below = ZERO
        self.unclear = set()
        self.changed()

    def datum_shift(self, cycle: CycleText, statement: Statement) -> None:
        """An axis of CYCL DEF 7: replaces the shift along it, or adds to it with I."""
        shift = list(self.shift)
        for letter, adds, text in cycle.shifts(statement):
            axis = "XYZ".find(letter)
            if axis >= 0:
                value = self.value(text, statement)
                shift[axis] = value * self.unit_mm + (shift[axis] if adds else 0.0)
                if not adds and self.plane is None:
                    self.unclear.discard(axis)
                if not adds and not value:
                    self.cancelled.add(axis)
                else:
                    self.cancelled.discard(axis)
        self.shift = (shift[0], shift[1], shift[2])
        if self.plane is not None and any(self.below):
            self.unclear = {0, 1, 2}
        self.changed()

    def value(self, text: bytes, statement: Statement) -> float:
        """The number of a value as written, which may name a parameter."""
        upper = text.upper().lstrip(b"+")
        sign = -1.0 if upper.startswith(b"-") else 1.0
        name = upper.lstrip(b"-").decode("latin-1")
        if not name.startswith("Q"):
            return float(text)
        known = self.parameters.get(name)
        if known is None:
            raise ProgramError(
                f"{statement.shown} takes {name}, whose value is not known here",
                line=statement.line,
                code="OLP511",
                hint=UNROLL,
            )
        return sign * known
