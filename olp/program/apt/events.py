"""The running state of an APT reading, and the statements between points that change it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence

import numpy as np

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import CutterCompensation, Flag, Kind
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.apt.arcs import ArcForm, circle, directed, movarc
from olp.program.apt.chords import leaning
from olp.program.apt.controls import changes_tool, check_prefun, check_set, check_turn, numbers_of
from olp.program.apt.placing import OFF, Placing
from olp.program.dialect import Dialect, Options
from olp.program.frames import tool_vector_of
from olp.program.statement_rows import Points, StatementCollector
from olp.program.text.statements import Field, Statement, shown

NAN = float("nan")
#: text of INSERT that is a block of words, one of which may move
_BLOCK = re.compile(rb"(?i)\s*(?:[A-Z]\s*[=+-]?\s*[\d.]+\s*|\([^)]*\)\s*)+\Z")
_MOVING = re.compile(rb"(?i)[GXYZUVWABC]\s*[=+-]?\s*[\d.]|M\s*(?:98|6|06)\b|[PL]\s*\d")
#: words of CYCLE that set values and begin no cycle
_CYCLE_MESSAGE = frozenset((b"INIT", b"CLEAR", b"PARAM", b"AVOID"))
#: mm per minute of one unit of a feed per minute
_PER_MINUTE = {b"MMPM": 1.0, b"IPM": MM_PER_INCH, b"PERMIN": 1.0}
#: mm per turn of one unit of a feed per turn
_PER_TURN = {b"MMPR": 1.0, b"IPR": MM_PER_INCH, b"PERREV": 1.0}


@dataclass(frozen=True, slots=True)
class Cycle:
    """A cycle in force: depth below the point, clearance and height of the retract above it, in mm, None
    where not stated; its feed."""

    depth_mm: float | None
    clear_mm: float | None
    retract_mm: float | None
    feed_mm_s: float


class Events(Placing):
    """The state while one program is read, and a handler for each statement that changes it. `_resolve`,
    which the reader defines, turns the points before an event into positions."""

    def __init__(self, data: bytes, setup: Setup, dialect: Dialect, options: Options, words: bool) -> None:
        super().__init__(setup, StatementCollector(data, dialect, keep_words=words))
        self.data, self.options = data, options
        self.start = [NAN if p is None else p for p in setup.job.start_mm]
        self.position = list(self.start)
        self.skipped = 0
        self.home: list[float] | None = None
        self.cycle: Cycle | None = None
        self.last_cycle: Cycle | None = None
        self.turns_s = 0.0
        self.direction: Statement | None = None
        self.ended = 0
        self.feed_mm_s = NAN
        self.feed_stated = (0, -1)
        self.rapid: list[int] = []
        self.driven: dict[int, ArcForm] = {}
        self.arcs: list[tuple[int, ArcForm]] = []
        self.onward = 0
        self.back: list[int] = []
        self.unconfirmed: int | None = None
        #: the points of the chunk, and how many of them are moves
        self.points: Points
        self.done: int
        self._handlers: dict[bytes, Callable[[Statement, int], None]] = {
            b"FEDRAT": self._feed, b"UNITS": self._units, b"UNIT": self._units, b"CIRCLE": self._circle,
            b"MOVARC": self._circle, b"LOADTL": self._load, b"LOAD": self._load, b"TOOLNO": self._load,
            b"TURRET": self._load, b"CYCLE": self._cycle, b"CUTCOM": self._cutcom, b"TLAXIS": self._tlaxis,
            b"CSYS": self._csys, b"MSYS": self._csys, b"ORIGIN": self._csys, b"TRACUT": self._tracut,
            b"FROM": self._from, b"GOHOME": self._gohome, b"SPINDL": self._spindle, b"DELAY": self._delay,
            b"STOP": self._rest, b"OPSTOP": self._rest, b"RETRCT": self._unknown, b"GOCLER": self._unknown,
            b"INSERT": self._insert, b"INDIRV": self._indirv, b"FINI": self._fini, b"TRANS": self._trans,
            b"COPY": self._copy,
            b"UNLOAD": self._unknown, b"AUXFUN": self._auxfun, b"PREFUN": self._prefun, b"SET": self._set,
            b"OPSKIP": self._opskip, b"ROTABL": self._turn, b"ROTATE": self._turn, b"ROTHED": self._turn,
        }  # fmt: skip

    def _move(self, row: int) -> int:
        """The number of the move that a point becomes."""
        if self.cycle is not None or any(arc_row < row for arc_row, _ in self.arcs if self.may_lean):
            self._resolve(row)
        return self.collector.moves + row - self.done

    def _unknown(self, statement: Statement, row: int) -> None:
        """A move that the control makes by itself: no position is known after it."""
        self._resolve(row)
        self.position = [NAN] * 3
        if self.collector.moves:
            self.collector.put_lone(
                Kind.RAPID,
                Flag.PASS | Flag.CONTROL,
                statement.line,
                len(self.table.frames) - 1,
                self.position,
            )
        else:
            self.start = [NAN] * 3

    def _feed(self, statement: Statement, row: int) -> None:
        self.feed_mm_s = feed_of(statement, self.unit_mm, self.turns_s)
        value = next((f for f in statement.fields() if f.number is not None), None)
        self.feed_stated = statement.line, -1 if value is None else self.collector.word(value)
        self.collector.put_feed(self._move(row), self.feed_mm_s, *self.feed_stated)

    def _units(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        words = [f.text for f in statement.fields()]
        if words[:1] == [b"MM"]:
            self.unit_mm = 1.0
        elif words[:1] in ([b"INCH"], [b"INCHES"], [b"IN"]):
            self.unit_mm = MM_PER_INCH
        else:
            raise ProgramError(
                "UNITS names a unit that is not read; expected MM or INCH", line=statement.line, code="OLP516"
            )
        self.unit_stated = True

    def _circle(self, statement: Statement, row: int) -> None:
        form = (movarc if statement.head()[1] == b"MOVARC" else circle)(statement, self.collector)
        if self.arcs and self.arcs[-1][0] == row:
            raise ProgramError(
                "an arc follows an arc without a GOTO between them; expected a GOTO to the end of the first",
                line=statement.line,
                code="OLP532",
            )
        self._put_arc(row, form)

    def _tlon(self, statement: Statement, row: int) -> None:
        if self.direction is None:
            raise ProgramError(
                "no INDIRV comes before TLON, so its direction is not known; expected one before each TLON",
                line=statement.line,
                code="OLP532",
            )
        form = directed(self.driven.pop(statement.line), self.direction, self.collector)
        self.direction = None
        self._put_arc(row, form)

    def _put_arc(self, row: int, form: ArcForm) -> None:
        self.may_lean |= bool(leaning([form], None)[0])
        self.arcs.append((row, form))

    def _indirv(self, statement: Statement, row: int) -> None:
        self.direction = statement

    def _load(self, statement: Statement, row: int) -> None:
        fields = statement.fields()
        if fields and fields[0].text == b"TOOL":
            fields = fields[1:]
        number = fields[0].number if fields else None
        if number is None or (number[1] and number[0] % 10 ** number[1]):
            raise ProgramError(
                f"{shown(statement.head()[1])} needs the number of a tool", line=statement.line, code="OLP516"
            )
        self._unknown(statement, row)
        self.tool = number[0] // 10 ** number[1]
        self.length_active = True
        if self.tool and self.setup.tool(self.tool) is None:
            tool_vector_of(self.setup, self.tool, statement.line)

    def _cycle(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        fields = statement.fields()
        word = fields[0].text if fields else b""
        if word in OFF:
            self.cycle = None
        elif word == b"ON":
            self.cycle = self.last_cycle
        elif word not in _CYCLE_MESSAGE or len(fields) > 1:
            self.cycle = self.last_cycle = self._cycle_of(fields)

    def _cycle_of(self, fields: Sequence[Field]) -> Cycle:
        after: dict[bytes, float] = {}
        for word, number in itertools.pairwise(fields):
            pair = number.number
            if word.number is None and pair is not None:
                after.setdefault(word.text, pair[0] / 10.0 ** pair[1])

        def length(*names: bytes) -> float | None:
            return next((abs(after[n]) * self.unit_mm for n in names if n in after), None)

        feed = NAN
        for name, scale in _PER_MINUTE.items():
            if name in after:
                feed = after[name] * (self.unit_mm if name == b"PERMIN" else scale) / 60.0
        return Cycle(
            length(b"DEPTH", b"FEDTO"), length(b"CLEAR", b"RAPTO"), length(b"RTRCTO", b"RETURN"), feed
        )

    def _cutcom(self, statement: Statement, row: int) -> None:
        words = {f.text for f in statement.fields()}
        self._resolve(row)
        if b"OFF" in words:
            self.compensation = None
        elif words & {b"LEFT", b"RIGHT"}:
            self.compensation = CutterCompensation(plane=0, left=b"LEFT" in words)

    def _from(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        numbers = [f.number for f in statement.fields()]
        if len(numbers) < 3 or None in numbers[:3]:
            what = f"{shown(statement.head()[1])} needs three numbers"
            raise ProgramError(what, line=statement.line, code="OLP516")
        if self.tips and len(numbers) > 3:
            raise ProgramError(
                f"{shown(statement.head()[1])} has a tool axis, which is not read there; state it in the "
                "next GOTO or by TLAXIS, and write three numbers",
                line=statement.line,
                code="OLP565",
            )
        numbers = numbers[:3]
        point = np.array([n[0] / 10.0 ** n[1] for n in numbers if n is not None]) * self.unit_mm
        number = self._frame(statement.line)
        frame = self.table.frames[number]
        point = point if frame.turn is None else np.array(frame.turn) @ point
        self.position = (point + np.array(frame.offset_mm)).tolist()
        self.home = list(self.position)
        if self.collector.moves:
            self.collector.put_lone(Kind.RAPID, Flag.PASS, statement.line, number, self.position)
        else:
            self.start = list(self.position)

    def _gohome(self, statement: Statement, row: int) -> None:
        if len(numbers_of(statement)) >= 3:
            home = self.home
            self._from(statement, row)
            self.home = home
            return
        if self.home is None:
            self._unknown(statement, row)
            return
        self._resolve(row)
        self.position = list(self.home)
        number = self._frame(statement.line)
        self.collector.put_lone(Kind.RAPID, Flag.PASS, statement.line, number, self.position)

    def _spindle(self, statement: Statement, row: int) -> None:
        numbers = [f.number for f in statement.fields() if f.number is not None]
        if numbers:
            self.turns_s = abs(numbers[0][0] / 10.0 ** numbers[0][1]) / 60.0
        self._rest(statement, row)

    def _delay(self, statement: Statement, row: int) -> None:
        number = next((f.number for f in statement.fields() if f.number is not None), None)
        if number is None:
            raise ProgramError("DELAY needs a number of seconds", line=statement.line, code="OLP516")
        if any(f.text == b"REV" for f in statement.fields()):
            seconds = number[0] / 10.0 ** number[1] / self.turns_s if self.turns_s else 0.0
        else:
            seconds = number[0] / 10.0 ** number[1]
        self.collector.pauses.append((self._move(row), max(seconds, 0.0)))

    def _rest(self, statement: Statement, row: int) -> None:
        self.collector.pauses.append((self._move(row), 0.0))

    def _insert(self, statement: Statement, row: int) -> None:
        block = re.sub(rb"(?i)\A\s*INSERT\s*/?", b"", statement.text)
        if _BLOCK.match(block) and _MOVING.search(block):
            raise ProgramError(
                "INSERT gives the control a block that may move the machine; "
                "leave such blocks to the post-processor",
                line=statement.line,
                code="OLP512",
            )

    def _auxfun(self, statement: Statement, row: int) -> None:
        if changes_tool(statement):
            self._unknown(statement, row)

    def _prefun(self, statement: Statement, row: int) -> None:
        check_prefun(statement, self.setup.machine.default_work_offset)

    def _set(self, statement: Statement, row: int) -> None:
        check_set(statement)

    def _copy(self, statement: Statement, row: int) -> None:
        raise ProgramError(
            "COPY repeats the moves since INDEX", hint="unroll the program with --flatten",
            line=statement.line, code="OLP511",
        )  # fmt: skip

    def _turn(self, statement: Statement, row: int) -> None:
        check_turn(statement)

    def _opskip(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        self.skipped = 0 if any(f.text in OFF for f in statement.fields()) else statement.line

    def _fini(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        self.ended = statement.line


def feed_of(statement: Statement, unit_mm: float, turns_s: float) -> float:
    """mm/s of a FEDRAT; NaN where it states no speed."""
    value, words = NAN, set()
    for field in statement.fields():
        pair = field.number
        if pair is None:
            words.add(field.text)
        elif value != value:
            value = pair[0] / 10.0 ** pair[1]
    for name, scale in _PER_MINUTE.items():
        if name in words:
            return value * (unit_mm if name == b"PERMIN" else scale) / 60.0
    for name, scale in _PER_TURN.items():
        if name in words:
            return value * (unit_mm if name == b"PERREV" else scale) * turns_s if turns_s else NAN
    return NAN if words & {b"INVERSE", b"INVERS"} else value * unit_mm / 60.0
