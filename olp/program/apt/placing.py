"""Where the points of a program of APT lie: coordinate systems, transforms, the tool and its axis."""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector
from olp.core.toolpath import CutterCompensation
from olp.core.turns import Turn
from olp.program.apt.controls import numbers_of
from olp.program.apt.transforms import NOTHING, Rigid, rigid
from olp.program.frames import UP, FrameTable, Placement, product, tool_vector_of, turn_of, turned
from olp.program.statement_rows import StatementCollector
from olp.program.text.statements import Statement, shown

OFF = frozenset((b"OFF", b"NOMORE"))
#: how far the length of a direction may be from 1
UNIT = 1e-3
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


class Placing:
    """The state of a reading that frames depend on, and the statements that change it. `_resolve`, which the
    reader defines, turns the points before a statement into positions."""

    def __init__(self, setup: Setup, collector: StatementCollector) -> None:
        self.setup, self.collector, self.tips = setup, collector, collector.dialect.tips
        self.table = FrameTable(setup)
        self.unit_mm, self.unit_stated = 1.0, False
        self.tool = setup.machine.default_tool
        self.length_active = setup.machine.length_active
        self.axis: Vector = UP
        self.up: Vector = UP
        #: the direction that the last point states, or has from before, and how its frame lies
        self.aimed: tuple[Vector, Turn | None] | None = None
        self.systems: list[tuple[object, object]] = []
        self.system: tuple[object, object] = (None, None)
        self.transform: Rigid = NOTHING
        self.shift: Vector = ZERO
        self.compensation: CutterCompensation | None = None
        #: whether an arc may lie in no plane of two axes
        self.may_lean = any(
            any(work.rotation_deg)
            for work in (*setup.machine.work_offsets.values(), *setup.job.work_offsets.values())
        )

    def _frame(self, line: int) -> int:
        """The number of the present frame."""
        name = self.setup.machine.default_work_offset
        if self.system not in self.systems:
            self.systems.append(self.system)
        count = self.systems.index(self.system) + 1
        own = f"CSYS{count}"
        if count > 1 or self.setup.work_offset(own) is not None:
            name = own
        work = self.table.work_offset(
            name, line, "the program" if count == 1 else f"coordinate system {count} of the program"
        )
        length = tool_vector = ZERO
        if self.tool:
            tool_vector = tool_vector_of(self.setup, self.tool, line)
            if self.length_active and not self.tips:
                tool = self.setup.tool(self.tool)
                assert tool is not None
                length = tool.length_mm
        inner = self._placement()
        # an axis that was never stated is the Z axis of the machine
        turn = product(turn_of(work.rotation_deg), inner.turn)
        # rotary axes turn the tool, where the machine has them
        self.up = UP if self.axis == UP or self.tips else turned(turn, self.axis)
        length_active = self.length_active and bool(self.tool) and not self.tips
        number = self.table.index(
            work, line, inner=inner, unit_mm=self.unit_mm, tool=self.tool, length=length,
            tool_vector=tool_vector, axis=self.up, length_active=length_active,
            compensation=self.compensation,
        )  # fmt: skip
        return self.table.tipped(number, self.tips) if self.tips else number

    def _placement(self) -> Placement:
        """The transforms in force: TRACUT first, then TRANS."""
        stated = zip(self.transform.shift, self.shift, strict=True)
        x, y, z = ((a + b) * self.unit_mm for a, b in stated)
        return Placement(self.transform.turn, (x, y, z))

    def _tlaxis(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        numbers = [f.number for f in statement.fields()]
        if len(numbers) != 3 or None in numbers:
            raise ProgramError(
                "TLAXIS is read with three numbers only: the direction from tip to gauge point",
                line=statement.line,
                code="OLP516",
            )
        x, y, z = (n[0] / 10.0 ** n[1] for n in numbers if n is not None)
        size = (x * x + y * y + z * z) ** 0.5
        if not abs(size - 1.0) < UNIT:
            raise ProgramError(
                f"TLAXIS has length {size:.6g}; expected a direction of length 1",
                line=statement.line,
                code="OLP516",
            )
        self.axis, self.aimed = axis_of(x / size, y / size, z / size), None

    def _csys(self, statement: Statement, row: int) -> None:
        values = []
        for field in statement.fields():
            pair = field.number
            if pair is None:
                if field.text in OFF:
                    continue
                raise ProgramError(
                    f"the coordinate system is given by the name {shown(field.text)}; expected its numbers",
                    line=statement.line,
                    code="OLP523",
                )
            values.append(round(pair[0] / 10.0 ** pair[1], 9))
        key: object = tuple(values)
        if key == _IDENTITY or not any(values) or key == (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0):
            key = None
        csys, origin = self.system
        system = (csys, key) if statement.head()[1] == b"ORIGIN" else (key, origin)
        if system != self.system:
            self._resolve(row)
            self.system = system

    def _tracut(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        words = [f.text for f in statement.fields()]
        if words in ([], [b"NOMORE"], [b"OFF"]):
            self.transform = NOTHING
            return
        self.transform = rigid(words, statement)
        self.may_lean |= self.transform.turn is not None
        self._transformed(statement)

    def _trans(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        words = [f.text for f in statement.fields()]
        numbers = numbers_of(statement)
        if words in ([b"NOMORE"], [b"OFF"]):
            numbers = [0.0] * 3
        elif len(numbers) != 3 or len(words) != 3:
            raise ProgramError(
                "TRANS is read with three numbers: the shift of the points after it",
                line=statement.line,
                code="OLP516",
            )
        x, y, z = numbers
        self.shift = (x, y, z)
        if any(numbers):
            self._transformed(statement)

    def _transformed(self, statement: Statement) -> None:
        name = shown(statement.head()[1])
        self.collector.remarks.setdefault(
            "transform", (statement.line, f"{name} is taken as applied to the points after it")
        )

    def _resolve(self, upto: int) -> None:
        raise NotImplementedError


def axis_of(x: float, y: float, z: float) -> Vector:
    return (x, y, z) if (x, y) != (0.0, 0.0) or z < 0 else UP
