"""The running state of a DMIS reading, and the statements between points that change it."""

from __future__ import annotations

import re
from collections.abc import Callable

from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup, Vector
from olp.core.toolpath import Flag, Kind
from olp.core.units import MM_PER_INCH
from olp.program.dialect import Dialect
from olp.program.dmis.points import ANGLES, WORKING_PLANES
from olp.program.frames import FrameTable, tool_vector_of
from olp.program.statement_rows import Points, StatementCollector
from olp.program.text.statements import Statement, shown

NAN = float("nan")
#: mm per unit of length
_UNITS = {b"MM": 1.0, b"CM": 10.0, b"M": 1000.0, b"INCH": MM_PER_INCH}
#: mm/s per unit of speed
_SPEEDS = {b"MMPS": 1.0, b"MPM": 1000.0 / 60.0, b"IPS": MM_PER_INCH, b"IPM": MM_PER_INCH / 60.0,
           b"MPMM": 1000.0 / 60.0, b"MMPM": 1.0 / 60.0}  # fmt: skip
#: words of DMESW that run nothing
_SOFTWARE = frozenset((b"CONTIN", b"PAUSE"))
_LABEL = re.compile(rb"(?i)\A\s*([A-Z]+)\s*\(\s*([^()]*?)\s*\)\s*\Z")
#: the frame of a program before its first datum: axis positions of the machine, as the control counts them
MACHINE_FRAME = "MCS"


class Events:
    """The state while one program is read, and a handler for each statement that changes it. `_resolve`,
    which the reader defines, turns the points before an event into positions."""

    def __init__(self, data: bytes, setup: Setup, dialect: Dialect, words: bool) -> None:
        self.data, self.setup = data, setup
        self.collector = StatementCollector(data, dialect, keep_words=words)
        self.table = FrameTable(setup)
        self.start = [NAN if p is None else p for p in setup.job.start_mm]
        self.unit_mm, self.unit_stated = 1.0, False
        self.angle_rad = ANGLES[b"ANGDEC"]
        #: number of the working plane, None for one that is not of two axes
        self.plane: int | None = 0
        #: where the machine is, NaN where only the control knows
        self.position = list(self.start)
        self.datum = MACHINE_FRAME
        self.sensor: str | None = None
        #: the sensor of a RECALL, and its line, until SNSLCT selects one
        self.recalled: tuple[str, int] | None = None
        self.defined: dict[str, Vector | None] = {}
        self.manual = False
        self.feature: tuple[int, bool] | None = None
        self.speed = {b"POSVEL": NAN, b"MESVEL": NAN}
        self.nesting: list[bytes] = []
        self.macro: str | None = None
        self.moving_macros: set[str] = set()
        self.macros: set[str] = set()
        self.header = False
        self.ended = 0
        self.touches: set[int] = set()
        #: the points of the chunk, and how many of them are moves
        self.points: Points
        self.done: int
        self._handlers: dict[bytes, Callable[[Statement, bytes, int], None]] = {
            b"UNITS": self._units, b"SNSDEF": self._snsdef, b"SNSLCT": self._snslct, b"TRANS": self._datum,
            b"ROTATE": self._datum, b"DATSET": self._datum, b"RECALL": self._recall, b"MODE": self._mode,
            b"TECOMP": self._thermal, b"TEMPR": self._thermal, b"FEDRAT": self._feed, b"MEAS": self._meas,
            b"RMEAS": self._meas, b"ENDMES": self._endmes, b"FROM": self._from, b"GOHOME": self._gohome,
            b"IF": self._branch, b"ELSE": self._branch, b"ELSEIF": self._branch, b"ENDIF": self._branch,
            b"DO": self._branch, b"ENDDO": self._branch, b"MACRO": self._macro, b"ENDMAC": self._endmac,
            b"CALL": self._call, b"ENDFIL": self._endfil, b"DECL": self._unchanged, b"RAPID": self._unchanged,
            b"WKPLAN": self._workplane, b"CALIB": self._calib, b"PAMEAS": self._scan,
            b"DMESW": self._software,
        }  # fmt: skip

    def _frame(self, line: int) -> int:
        if self.recalled is not None and self.recalled[0] != self.sensor:
            raise ProgramError(
                f"RECALL brings the sensor {self.recalled[0]} back, and whether it selects it too is not "
                "known; put SNSLCT behind it",
                line=self.recalled[1],
                code="OLP516",
            )
        what = "the frame of the machine" if self.datum == MACHINE_FRAME else f"the datum D({self.datum})"
        name = next(
            (n for n in (*self.setup.job.work_offsets, *self.setup.machine.work_offsets)
             if n.upper() == self.datum.upper()),
            self.datum,
        )  # fmt: skip
        work = self.table.work_offset(name, line, what)
        tool_vector, tool = ZERO, None
        if self.sensor is not None:
            tool_vector = self._stylus(self.sensor, line)
        elif self.setup.machine.default_tool:
            tool = self.setup.machine.default_tool
            tool_vector = tool_vector_of(self.setup, tool, line)
        # the control counts its axes at the end of the ram: the tip is at that point plus the offset of the
        # stylus
        x, y, z = (0.0 - v for v in tool_vector)
        return self.table.index(
            work, line, unit_mm=self.unit_mm, tool=tool, length=(x, y, z), tool_vector=tool_vector,
            length_active=tool is not None,
        )  # fmt: skip

    def _stylus(self, name: str, line: int) -> Vector:
        stated = self.setup.stylus(name)
        if stated is not None:
            return stated
        defined = self.defined.get(name)
        if defined is None:
            raise ProgramError(
                f'the stylus {name} is selected, and its offset is not stated; give [styli."{name}"] '
                "offset_mm = [x, y, z] in the job or machine file, end of the ram to centre of the tip",
                line=line,
                code="OLP522",
                missing=("styli", name),
            )
        return defined

    def _unknown(self, statement: Statement, row: int) -> None:
        """After this statement the position of the machine is not known."""
        self._resolve(row)
        self.position = [NAN] * 3
        if self.collector.moves:
            self.collector.put_lone(
                Kind.RAPID, Flag.PASS | Flag.CONTROL, statement.line, len(self.table.frames) - 1, [NAN] * 3
            )
        else:
            self.start = [NAN] * 3

    def _settled(self, statement: Statement) -> None:
        """Refuse a change of the state that does not happen in every run of the program."""
        if self.nesting:
            raise ProgramError(
                f"{shown(statement.head()[1])} is inside {shown(self.nesting[-1])}, "
                "so whether it holds is known at run time only; move it before or after",
                line=statement.line,
                code="OLP511",
            )

    def _unchanged(self, statement: Statement, label: bytes, row: int) -> None:
        return

    def _units(self, statement: Statement, label: bytes, row: int) -> None:
        self._settled(statement)
        self._resolve(row)
        fields = statement.fields()
        unit = _UNITS.get(fields[0].text) if fields else None
        if unit is None:
            what = "UNITS names a unit that is not read; expected MM, CM, M or INCH"
            raise ProgramError(what, line=statement.line, code="OLP512")
        self.unit_mm, self.unit_stated = unit, True
        self.angle_rad = next((ANGLES[f.text] for f in fields if f.text in ANGLES), self.angle_rad)

    def _workplane(self, statement: Statement, label: bytes, row: int) -> None:
        self._settled(statement)
        self._resolve(row)
        fields = statement.fields()
        self.plane = WORKING_PLANES.get(fields[0].text) if fields else None

    def _snsdef(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        cart = next((i for i, f in enumerate(fields) if f.text == b"CART"), -1)
        fixed = any(f.text == b"FIXED" for f in fields[:cart])
        numbers = [f.number for f in fields[cart + 1 : cart + 4]]
        name = _name(label)
        if name is None:
            return
        self.defined[name] = None
        if cart > 0 and fixed and len(numbers) == 3 and None not in numbers:
            x, y, z = (n[0] / 10.0 ** n[1] * self.unit_mm for n in numbers if n is not None)
            self.defined[name] = (x, y, z)

    def _snslct(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        name = _name(fields[0].text) if fields else None
        if name is None:
            raise ProgramError(
                "SNSLCT names no sensor; expected S() or SA()", line=statement.line, code="OLP516"
            )
        if name == self.sensor and self.recalled is None:
            return
        self._settled(statement)
        if name == self.sensor:
            self._resolve(row)
        else:
            self._unknown(statement, row)
        self.sensor, self.recalled = name, None

    def _datum(self, statement: Statement, label: bytes, row: int) -> None:
        name = _name(label)
        if name is None:
            raise ProgramError(
                f"{shown(statement.head()[1])} has no label, so its frame has no name; expected D(name) = …",
                line=statement.line,
                code="OLP516",
            )
        self._settled(statement)
        self._resolve(row)
        self.datum = name

    def _recall(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        match = _LABEL.match(fields[0].text) if fields else None
        if match is None or match[1] == b"RT":
            raise ProgramError(
                "RECALL is read for datums, sensors and features only; give D(), DA(), S(), SA(), F() "
                "or FA()",
                line=statement.line,
                code="OLP516",
            )
        kind, name = match[1], match[2].decode("latin-1")
        if kind not in (b"D", b"DA", b"S", b"SA"):
            return
        self._settled(statement)
        self._resolve(row)
        if kind in (b"D", b"DA"):
            self.datum = name
        else:
            self.recalled = name, statement.line

    def _mode(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        self._settled(statement)
        self._resolve(row)
        self.manual = bool(fields) and fields[0].text == b"MAN"

    def _thermal(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        if any(f.text == b"OFF" for f in fields[:1]):
            return
        name = shown(statement.head()[1])
        self.collector.remarks.setdefault("thermal", (statement.line, f"{name} makes the control compensate"))

    def _feed(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        numbers = [f.number for f in fields if f.number is not None]
        unit = next((_SPEEDS[f.text] for f in fields if f.text in _SPEEDS), NAN)
        if fields and fields[0].text in self.speed and numbers:
            self.speed[fields[0].text] = numbers[0][0] / 10.0 ** numbers[0][1] * unit
        if fields and fields[0].text == b"MESVEL":
            self.collector.put_feed(
                self.collector.moves + row - self.done, self.speed[b"MESVEL"], statement.line
            )

    def _meas(self, statement: Statement, label: bytes, row: int) -> None:
        if self.feature is not None:
            raise ProgramError(
                "MEAS is inside MEAS; expected ENDMES before it", line=statement.line, code="OLP532"
            )
        self.feature = (statement.line, False)

    def _calib(self, statement: Statement, label: bytes, row: int) -> None:
        """A stylus is calibrated at touches, as a feature is measured."""
        fields = statement.fields()
        if not fields or fields[0].text != b"SENS":
            what = shown(fields[0].text) if fields else "nothing"
            raise ProgramError(
                f"CALIB/{what} is not read; expected CALIB/SENS, or a program without the calibration",
                line=statement.line,
                code="OLP512",
            )
        self._meas(statement, label, row)

    def _scan(self, statement: Statement, label: bytes, row: int) -> None:
        """The control follows the surface along a path: no position of it is corrected."""
        if self.feature is None:
            raise ProgramError(
                "PAMEAS is outside MEAS and ENDMES; expected MEAS before it",
                line=statement.line,
                code="OLP532",
            )
        self._unknown(statement, row)
        self.feature = (self.feature[0], True)
        self.collector.remarks.setdefault(
            "scan", (statement.line, "PAMEAS scans along a path, which is left uncorrected")
        )

    def _software(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        if not fields or fields[0].text not in _SOFTWARE:
            raise ProgramError(
                "DMESW hands a command to the software of the machine, which may move it; take it out",
                line=statement.line,
                code="OLP512",
            )

    def _endmes(self, statement: Statement, label: bytes, row: int) -> None:
        if self.feature is None:
            raise ProgramError("ENDMES has no MEAS before it", line=statement.line, code="OLP532")
        if not self.feature[1]:
            # the control chooses the points itself
            self._unknown(statement, row)
        self.feature = None

    def _from(self, statement: Statement, label: bytes, row: int) -> None:
        self._resolve(row)

    def _gohome(self, statement: Statement, label: bytes, row: int) -> None:
        self._unknown(statement, row)

    def _branch(self, statement: Statement, label: bytes, row: int) -> None:
        _, major = statement.head()
        word = b"IF" if major[:2] == b"IF" else major
        self._unknown(statement, row)
        if word in (b"IF", b"DO"):
            self.nesting.append(word)
        elif word in (b"ENDIF", b"ENDDO"):
            if not self.nesting or self.nesting[-1] != word[3:]:
                raise ProgramError(
                    f"{shown(word)} has no {shown(word[3:])} before it", line=statement.line, code="OLP532"
                )
            self.nesting.pop()

    def _macro(self, statement: Statement, label: bytes, row: int) -> None:
        name = _name(label)
        if name is None:
            return  # WinWerth begins its programs with such a line
        self._resolve(row)
        self.macro = name
        self.macros.add(name.upper())
        self.nesting.append(b"MACRO")

    def _endmac(self, statement: Statement, label: bytes, row: int) -> None:
        self._resolve(row)
        if self.macro is not None:
            self.macro = None
            self.nesting.pop()

    def _call(self, statement: Statement, label: bytes, row: int) -> None:
        fields = statement.fields()
        name = next((n for f in fields if (n := _name(f.text)) is not None), None)
        if name is None or name.upper() not in self.macros:
            raise ProgramError(
                "CALL runs a macro that is not in this program and may move the machine; "
                "put the macro into this program",
                line=statement.line,
                code="OLP542",
            )

    def _endfil(self, statement: Statement, label: bytes, row: int) -> None:
        self._resolve(row)
        self.ended = statement.line

    def _resolve(self, upto: int) -> None:
        raise NotImplementedError


def _name(label: bytes) -> str | None:
    """The name in the brackets of S(), D(), M()."""
    match = _LABEL.match(label)
    return match[2].decode("latin-1") if match else None
