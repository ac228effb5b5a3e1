"""Reads APT and cutter-location data: statements to a nominal toolpath and the words that can be edited.

The way of a chunk: lines of plain GOTOs in columns and all other statements one by one (`statement_lexer`),
then the events between the points in their order, and stretches of points between changes of frame at once.
Nothing here knows an error model.
"""

from __future__ import annotations

import itertools
import re
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from olp.exceptions import ProgramError
from olp.machine import ZERO, Setup, Vector
from olp.program.apt_arcs import ArcForm, circle, directed, movarc, resolved, tlon
from olp.program.apt_table import FREE, TABLE
from olp.program.dialect import Dialect, Options, Support
from olp.program.frames import UP, FrameTable, lever_of, turn_of, turned
from olp.program.program import Program
from olp.program.statement_lexer import Chunk, Comment, Field, Statement, chunks
from olp.program.statement_rows import Array, Index, Mask, Point, Points, StatementCollector
from olp.toolpath import Flag, Kind
from olp.units import MM_PER_INCH

NAN = float("nan")
_FREE = re.compile(rb"(?i)(?:" + b"|".join(FREE) + rb")(?![A-Z])")
_CREO = re.compile(rb"\$\$->\s*([A-Z_]+)\s*/?")
_RAPID = frozenset((b"RAPID", b"RAPID/"))
#: text of INSERT that is a block of words, one of which may move
_BLOCK = re.compile(rb"(?i)\s*(?:[A-Z]\s*[=+-]?\s*[\d.]+\s*|\([^)]*\)\s*)+\Z")
_MOVING = re.compile(rb"(?i)[GXYZUVWABC]\s*[=+-]?\s*[\d.]|M\s*(?:98|6|06)\b|[PL]\s*\d")
_OFF = frozenset((b"OFF", b"NOMORE"))
#: words of CYCLE that state something and begin none
_CYCLE_TALK = frozenset((b"INIT", b"CLEAR", b"PARAM", b"AVOID"))
#: how far a direction may be from length 1
_UNIT = 1e-3
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True)
class _Cycle:
    """A cycle in force: depth below the point, clearance and height of the retract above it, in mm, None
    where not stated; its feed."""

    depth_mm: float | None
    clear_mm: float | None
    retract_mm: float | None
    feed_mm_s: float


def read(data: bytes, setup: Setup, dialect: Dialect, options: Options, *, words: bool = True) -> Program:
    """Read a whole program. Raises ProgramError with the line of the first statement that cannot be read
    right."""
    return _Reader(data, setup, dialect, options, words).run()


class _Reader:
    """One reading of one program."""

    def __init__(self, data: bytes, setup: Setup, dialect: Dialect, options: Options, words: bool) -> None:
        self.data, self.setup, self.options = data, setup, options
        self.out = StatementCollector(data, dialect, keep_words=words)
        self.table = FrameTable(setup)
        self.start = [NAN if p is None else p for p in setup.job.start_mm]
        self.position = list(self.start)
        self.unit_mm, self.unit_stated = 1.0, False
        self.tool = setup.machine.default_tool
        self.length_active = setup.machine.length_active
        self.axis: Vector = UP
        self.up: Vector = UP
        self.systems: list[tuple[object, object]] = []
        self.system: tuple[object, object] = (None, None)
        self.home: list[float] | None = None
        self.cycle: _Cycle | None = None
        self.last_cycle: _Cycle | None = None
        self.turns_s = 0.0
        self.direction: Statement | None = None
        self.ended = 0
        self.feed_mm_s = NAN
        self.feed_said = (0, -1)
        self.rapid: list[int] = []
        self.driven: dict[int, ArcForm] = {}
        self.arcs: list[tuple[int, ArcForm]] = []
        self.points: Points
        self.done = 0
        self._handlers: dict[bytes, Callable[[Statement, int], None]] = {
            b"FEDRAT": self._feed, b"UNITS": self._units, b"UNIT": self._units, b"CIRCLE": self._circle,
            b"MOVARC": self._circle, b"LOADTL": self._load, b"LOAD": self._load, b"TOOLNO": self._load,
            b"TURRET": self._load, b"CYCLE": self._cycle, b"CUTCOM": self._cutcom, b"TLAXIS": self._tlaxis,
            b"CSYS": self._csys, b"MSYS": self._csys, b"ORIGIN": self._csys, b"TRACUT": self._tracut,
            b"FROM": self._from, b"GOHOME": self._gohome, b"SPINDL": self._spindle, b"DELAY": self._delay,
            b"STOP": self._rest, b"OPSTOP": self._rest, b"RETRCT": self._unknown, b"GOCLER": self._unknown,
            b"INSERT": self._insert, b"INDIRV": self._indirv, b"FINI": self._fini,
        }  # fmt: skip

    def run(self) -> Program:
        for chunk in chunks(self.data):
            self._chunk(chunk)
        x, y, z = self.start
        end = self.ended or self.data.count(b"\n") + 1
        return self.out.program(self.table.frames, (x, y, z), end, b"RAPID")

    # -- one chunk -----------------------------------------------------------------------------------

    def _chunk(self, chunk: Chunk) -> None:
        out = self.out
        out.open(chunk)
        if self.ended:
            out.close()
            return
        events: list[Statement] = []
        alone: list[Point] = []
        carry = 0
        for found in chunk.statements(_FREE):
            if found.line <= carry:
                continue
            if isinstance(found, Comment):
                if found.text.lstrip()[:4] == b"$$->":
                    statement = self._creo(chunk, found)
                    carry = found.line + statement.lines - 1
                    events.append(statement)
                continue
            text = found.text.strip().upper()
            if text[:2] in (b"GO", b"TL") and (point := self._point(found, text)) is not None:
                alone.append(point)
            if text[:4] != b"GOTO":
                events.append(found)
            if text[:4] == b"FINI":
                break
        self.points = out.points(chunk, alone)
        self.done = 0
        upto = np.searchsorted(self.points.line, np.array([e.line for e in events], np.int64)).tolist()
        for statement, row in zip(events, upto, strict=True):
            self._event(statement, row)
            if self.ended:
                out.close()
                return
        self._resolve(len(self.points))
        # what was said of the point behind the last one holds for the first of the next chunk
        count = len(self.points)
        self.rapid = [row - count for row in self.rapid]
        self.arcs = [(row - count, form) for row, form in self.arcs]
        out.close()

    def _event(self, statement: Statement, row: int) -> None:
        text = statement.text.strip().upper()
        if text in _RAPID:
            self.rapid.append(row)
            return
        label, major = statement.head()
        if statement.text.lstrip()[:2] == b"$$":
            label, major = b"", b"CSYS"
        free = _FREE.match(text)
        if free:
            label, major = b"", free[0].upper()
        first = major.split(b",")[0].strip()
        handler = self._handlers.get(first)
        if first == b"RAPID":
            self._resolve(row)
            raise ProgramError("RAPID says more than one knows; expected RAPID alone", line=statement.line)
        if label:
            what = TABLE.get(first, (Support.REFUSED, "assigns what is not read"))[1]
            raise ProgramError(
                f"{shown(label)} = {shown(first)} {what or 'is not read'}", line=statement.line
            )
        if handler is not None:
            handler(statement, row)
            return
        support, why = TABLE.get(first, (Support.REFUSED, "is no statement that olp knows, and may move"))
        if first == b"TLON":
            self._tlon(statement, row)
        if first in (b"TLON", b"GODLTA"):
            return
        if support is Support.REFUSED:
            raise ProgramError(f"{shown(first)} {why}", line=statement.line)

    # -- points --------------------------------------------------------------------------------------

    def _point(self, statement: Statement, text: bytes) -> Point | None:
        """A GOTO, GODLTA or TLON that was not read in columns."""
        _, major = statement.head()
        line = statement.line
        if major.startswith(b"TLON"):
            self.driven[line], fields = tlon(statement, self.out)
            return Point(line, statement.begin, statement.end, fields)
        if major not in (b"GOTO", b"GODLTA"):
            return None
        fields = statement.fields()
        if fields and all(f.text == b"" for f in fields[-1:]):
            fields = fields[:-1]
        if any(f.number is None for f in fields):
            bad = next(f for f in fields if f.number is None)
            raise ProgramError(
                f"{shown(major)} names {shown(bad.text) or 'nothing'} where a number is expected; send the "
                "output of the APT processor (CLDATA)",
                line=line,
            )
        if len(fields) not in ((1, 3) if major == b"GODLTA" else (3, 6)):
            raise ProgramError(
                f"{shown(major)} has {len(fields)} numbers; expected "
                + ("a distance along the tool axis, or three" if major == b"GODLTA" else "three, or six"),
                line=line,
            )
        return Point(
            line, statement.begin, statement.end, fields[:3], fields[3:], incremental=major == b"GODLTA"
        )

    # -- stretches of points -------------------------------------------------------------------------

    def _resolve(self, upto: int) -> None:
        """Positions, kinds and arcs of the points up to `upto`, which have one frame but for tool axes."""
        a, self.done = self.done, max(upto, self.done)
        if upto <= a:
            return
        points, count = self.points, upto - a
        part = slice(a, upto)
        line = points.line[part]
        if not self.unit_stated:
            self.out.remarks.setdefault("unit", (int(line[0]), "the program states no unit"))
        frame, tilting, up = self._frames(points, part)
        offset, turn = self._places(frame)
        value = points.value[part] * self.unit_mm
        value = value if turn is None else value @ turn.T
        incremental = points.incremental[part]
        end = value + offset
        if incremental.any():
            self._check_increments(points, part, turn)
            end = _summed(value, end, incremental, self.position)
        kind = np.full(count, Kind.LINE, np.uint8)
        now = bisect_left(self.rapid, upto)
        kind[np.array(self.rapid[:now], np.int64) - a] = Kind.RAPID
        del self.rapid[:now]
        flag = np.where(incremental, np.uint8(Flag.INCREMENTAL), np.uint8(0))
        flag[tilting] |= np.uint8(Flag.WHOLE)
        slot, begin, stop = points.slot[part], points.begin[part], points.end[part]
        arcs = [(row - a, form) for row, form in self.arcs if row < upto]
        self.arcs = [(row, form) for row, form in self.arcs if row >= upto]
        if self.cycle is not None:
            if arcs:
                raise ProgramError("an arc stands under a CYCLE", line=int(line[arcs[0][0]]))
            self._holes(self.cycle, line, frame, end, slot, begin, stop, up)
        else:
            if arcs:
                rows = np.array([row for row, _ in arcs])
                if (kind[rows] == Kind.RAPID).any() or (flag[rows] & ~np.uint8(Flag.INCREMENTAL)).any():
                    bad = rows[(kind[rows] == Kind.RAPID) | (flag[rows] != 0)][0]
                    raise ProgramError("an arc at rapid, or with another tool axis", line=int(line[bad]))
                start = np.where(rows[:, None] > 0, end[np.maximum(rows - 1, 0)], np.array(self.position))
                found = resolved(
                    [form for _, form in arcs], start, end[rows], line[rows], self.unit_mm,
                    offset if offset.ndim == 1 else offset[rows], turn,
                )  # fmt: skip
                kind[rows] = np.where(found.sweep > 0, Kind.ARC_CCW, Kind.ARC_CW)
                self.out.put_arcs(rows + self.out.moves, found.centre, found.plane, found.sweep)
                for row, form in arcs:
                    self.out.arcs[row + self.out.moves] = form.text
            self.out.put_moves(kind, flag, line, frame, end, slot, begin, stop)
        self.position = end[-1].tolist()

    def _frames(self, points: Points, part: slice) -> tuple[Index, Mask, Array]:
        """Of each point: the number of its frame, whether the tool turns on the way to it, and the direction
        (n, 3) from tip to gauge point as the machine sees it."""
        direction, line = points.direction[part], int(points.line[part][0])
        count = len(direction)
        turning = np.zeros(count, bool)
        stated = ~np.isnan(direction[:, 0])
        if not stated.any():
            number = self._frame(line)
            return np.full(count, number), turning, np.broadcast_to(self.up, (count, 3))
        size = np.sqrt((direction * direction).sum(axis=1))
        wrong = stated & ~(np.abs(size - 1.0) < _UNIT)
        if wrong.any():
            at = int(np.flatnonzero(wrong)[0])
            raise ProgramError(
                f"the tool axis has length {size[at]:.6g}; expected a direction of length 1",
                line=int(points.line[part][at]),
            )
        held = np.maximum.accumulate(np.where(stated, np.arange(count), -1))
        axes = np.where((held >= 0)[:, None], (direction / size[:, None])[held], np.array(self.axis))
        before = np.vstack((np.array(self.axis), axes[:-1]))
        turning = (axes != before).any(axis=1)
        if not self.out.moves:
            turning[0] = False
        unique, which = np.unique(axes, axis=0, return_inverse=True)
        which = which.reshape(-1)
        number_of, up = np.zeros(len(unique), np.int64), np.zeros((len(unique), 3))
        for k, (x, y, z) in enumerate(unique.tolist()):
            self.axis = _axis(x, y, z)
            number_of[k] = self._frame(line)
            up[k] = self.up
        x, y, z = axes[-1].tolist()
        self.axis = _axis(x, y, z)
        return number_of[which], turning, up[which]

    def _frame(self, line: int) -> int:
        """The number of the present frame."""
        name = self.setup.machine.default_work_offset
        if self.system not in self.systems:
            self.systems.append(self.system)
        place = self.systems.index(self.system) + 1
        own = f"CSYS{place}"
        if place > 1 or self.setup.work_offset(own) is not None:
            name = own
        work = self.table.work_offset(
            name, line, "the program" if place == 1 else f"coordinate system {place} of the program"
        )
        length = lever = ZERO
        touched = None
        if self.tool:
            lever = lever_of(self.setup, self.tool, line)
            if self.length_active:
                tool = self.setup.tool(self.tool)
                assert tool is not None
                length = tool.length_mm
                if tool.set_by == "touch" and tool.touched_at_mm is not None:
                    touched = (tool.touched_at_mm, lever)
        # an axis that was never said is the machine's own
        self.up = UP if self.axis == UP else turned(turn_of(work.rotation_deg), self.axis)
        return self.table.index(
            work, line, unit_mm=self.unit_mm, tool=self.tool, length=length, lever=lever, axis=self.up,
            tool_touched=touched,
        )  # fmt: skip

    def _places(self, frame: Index) -> tuple[Array, Array | None]:
        frames = self.table.frames
        first = frames[int(frame[0])]
        turn = None if first.turn is None else np.array(first.turn)
        if (frame == frame[0]).all():
            return np.array(first.offset_mm), turn
        return np.array([f.offset_mm for f in frames])[frame], turn

    def _check_increments(self, points: Points, part: slice, turn: Array | None) -> None:
        alone = points.incremental[part] & (points.slot[part][:, 0] < 0)
        if alone.any() and self.axis != UP:
            raise ProgramError(
                "GODLTA with one number goes along the tool axis, which is tilted here; write it with three",
                line=int(points.line[part][np.flatnonzero(alone)[0]]),
            )

    def _holes(
        self, cycle: _Cycle, line: Index, frame: Index, end: Array, slot: Index, begin: Index,
        stop: Index, ups: Array,
    ) -> None:  # fmt: skip
        """Places of holes: to the clearance above the place, which the statement says, down, and up."""
        out = self.out
        at = np.array(self.position)
        for i in range(len(line)):
            where, up = int(line[i]), ups[i]
            x, y, z = (up * (cycle.clear_mm or 0.0)).tolist()
            own = self.table.lifted(int(frame[i]), (x, y, z)) if cycle.clear_mm else int(frame[i])
            at = end[i] + up * (cycle.clear_mm or 0.0)
            out.put_moves(
                np.array([Kind.RAPID], np.uint8), np.zeros(1, np.uint8), [where], [own], at[None],
                slot[i : i + 1], begin[i : i + 1], stop[i : i + 1],
            )  # fmt: skip
            out.put_feed(out.moves, cycle.feed_mm_s, where)
            if cycle.depth_mm is not None and cycle.clear_mm is not None:
                out.strokes.append((out.moves - 1, out.moves))
                out.put_lone(Kind.LINE, Flag.CYCLE, where, own, end[i] - up * cycle.depth_mm)
                at = end[i] + up * (cycle.retract_mm if cycle.retract_mm is not None else cycle.clear_mm)
                out.put_lone(Kind.RAPID, Flag.CYCLE, where, own, at)
        out.put_feed(out.moves, self.feed_mm_s, *self.feed_said)
        end[-1] = at

    def _unknown(self, statement: Statement, row: int) -> None:
        """A move of the control's own: no position is known after it."""
        self._resolve(row)
        self.position = [NAN] * 3
        if self.out.moves:
            self.out.put_lone(
                Kind.RAPID,
                Flag.PASS | Flag.CONTROL,
                statement.line,
                len(self.table.frames) - 1,
                self.position,
            )
        else:
            self.start = [NAN] * 3

    # -- events --------------------------------------------------------------------------------------

    def _move(self, row: int) -> int:
        """The number of the move that a point becomes."""
        if self.cycle is not None:
            self._resolve(row)
        return self.out.moves + row - self.done

    def _feed(self, statement: Statement, row: int) -> None:
        self.feed_mm_s = feed_of(statement, self.unit_mm, self.turns_s)
        said = next((f for f in statement.fields() if f.number is not None), None)
        self.feed_said = statement.line, -1 if said is None else self.out.word(said)
        self.out.put_feed(self._move(row), self.feed_mm_s, *self.feed_said)

    def _units(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        said = [f.text for f in statement.fields()]
        if said[:1] == [b"MM"]:
            self.unit_mm = 1.0
        elif said[:1] in ([b"INCH"], [b"INCHES"], [b"IN"]):
            self.unit_mm = MM_PER_INCH
        else:
            raise ProgramError("UNITS names no unit that is read; expected MM or INCH", line=statement.line)
        self.unit_stated = True

    def _circle(self, statement: Statement, row: int) -> None:
        form = (movarc if statement.head()[1] == b"MOVARC" else circle)(statement, self.out)
        if self.arcs and self.arcs[-1][0] == row:
            raise ProgramError("an arc follows an arc without a GOTO between them", line=statement.line)
        self.arcs.append((row, form))

    def _tlon(self, statement: Statement, row: int) -> None:
        if self.direction is None:
            raise ProgramError("TLON follows no INDIRV, so its direction is not known", line=statement.line)
        form = directed(self.driven.pop(statement.line), self.direction, self.out)
        self.direction = None
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
                f"{shown(statement.head()[1])} needs the number of a tool", line=statement.line
            )
        self._unknown(statement, row)
        self.tool = number[0] // 10 ** number[1]
        self.length_active = True
        if self.tool and self.setup.tool(self.tool) is None:
            lever_of(self.setup, self.tool, statement.line)

    def _cycle(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        fields = statement.fields()
        word = fields[0].text if fields else b""
        if word in _OFF:
            self.cycle = None
        elif word == b"ON":
            self.cycle = self.last_cycle
        elif word not in _CYCLE_TALK or len(fields) > 1:
            self.cycle = self.last_cycle = self._cycle_of(fields)

    def _cycle_of(self, fields: Sequence[Field]) -> _Cycle:
        after: dict[bytes, float] = {}
        for word, number in itertools.pairwise(fields):
            found = number.number
            if word.number is None and found is not None:
                after.setdefault(word.text, found[0] / 10.0 ** found[1])

        def length(*names: bytes) -> float | None:
            return next((abs(after[n]) * self.unit_mm for n in names if n in after), None)

        feed = NAN
        for name, scale in _PER_MINUTE.items():
            if name in after:
                feed = after[name] * scale / 60.0
        return _Cycle(
            length(b"DEPTH", b"FEDTO"), length(b"CLEAR", b"RAPTO"), length(b"RTRCTO", b"RETURN"), feed
        )

    def _cutcom(self, statement: Statement, row: int) -> None:
        said = {f.text for f in statement.fields()}
        if said & {b"LEFT", b"RIGHT", b"ON"} and not self.options.contour:
            raise ProgramError(
                "CUTCOM (cutter compensation) makes the path inside the control; send the path of the tool's "
                "centre, or take the points as that path with --contour",
                line=statement.line,
            )

    def _tlaxis(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        numbers = [f.number for f in statement.fields()]
        if len(numbers) != 3 or None in numbers:
            raise ProgramError("TLAXIS is read with three numbers only", line=statement.line)
        x, y, z = (n[0] / 10.0 ** n[1] for n in numbers if n is not None)
        size = (x * x + y * y + z * z) ** 0.5
        if not abs(size - 1.0) < _UNIT:
            raise ProgramError("TLAXIS is no direction of length 1", line=statement.line)
        self.axis = _axis(x / size, y / size, z / size)

    def _csys(self, statement: Statement, row: int) -> None:
        values = []
        for field in statement.fields():
            found = field.number
            if found is None:
                if field.text in (b"OFF", b"NOMORE"):
                    continue
                raise ProgramError(
                    f"a coordinate system is named {shown(field.text)}; expected its numbers",
                    line=statement.line,
                )
            values.append(round(found[0] / 10.0 ** found[1], 9) + 0.0)
        key: object = tuple(values)
        if key == _IDENTITY or not any(values) or key == (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0):
            key = None
        csys, origin = self.system
        system = (csys, key) if statement.head()[1] == b"ORIGIN" else (key, origin)
        if system != self.system:
            self._resolve(row)
            self.system = system

    def _tracut(self, statement: Statement, row: int) -> None:
        said = [f.text for f in statement.fields()]
        if said not in ([], [b"NOMORE"], [b"OFF"]):
            raise ProgramError(
                "TRACUT transforms points in the APT processor; send its output (CLDATA), or state the "
                "transform as a frame of the job",
                line=statement.line,
            )

    def _from(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        numbers = [f.number for f in statement.fields()][:3]
        if len(numbers) != 3 or None in numbers:
            raise ProgramError("FROM has no three numbers", line=statement.line)
        place = np.array([n[0] / 10.0 ** n[1] for n in numbers if n is not None]) * self.unit_mm
        number = self._frame(statement.line)
        frame = self.table.frames[number]
        place = place if frame.turn is None else np.array(frame.turn) @ place
        self.position = (place + np.array(frame.offset_mm)).tolist()
        self.home = list(self.position)
        if self.out.moves:
            self.out.put_lone(Kind.RAPID, Flag.PASS, statement.line, number, self.position)
        else:
            self.start = list(self.position)

    def _gohome(self, statement: Statement, row: int) -> None:
        if self.home is None:
            self._unknown(statement, row)
            return
        self._resolve(row)
        self.position = list(self.home)
        number = self._frame(statement.line)
        self.out.put_lone(Kind.RAPID, Flag.PASS, statement.line, number, self.position)

    def _spindle(self, statement: Statement, row: int) -> None:
        numbers = [f.number for f in statement.fields() if f.number is not None]
        if numbers:
            self.turns_s = abs(numbers[0][0] / 10.0 ** numbers[0][1]) / 60.0
        self._rest(statement, row)

    def _delay(self, statement: Statement, row: int) -> None:
        number = next((f.number for f in statement.fields() if f.number is not None), None)
        if number is None:
            raise ProgramError("DELAY needs a number of seconds", line=statement.line)
        if any(f.text == b"REV" for f in statement.fields()):
            seconds = number[0] / 10.0 ** number[1] / self.turns_s if self.turns_s else 0.0
        else:
            seconds = number[0] / 10.0 ** number[1]
        self.out.pauses.append((self._move(row), max(seconds, 0.0)))

    def _rest(self, statement: Statement, row: int) -> None:
        self.out.pauses.append((self._move(row), 0.0))

    def _insert(self, statement: Statement, row: int) -> None:
        said = re.sub(rb"(?i)\A\s*INSERT\s*/?", b"", statement.text)
        if _BLOCK.match(said) and _MOVING.search(said):
            raise ProgramError(
                "INSERT hands the control a block that may move the machine; leave it to the post-processor",
                line=statement.line,
            )

    def _fini(self, statement: Statement, row: int) -> None:
        self._resolve(row)
        self.ended = statement.line

    def _creo(self, chunk: Chunk, comment: Comment) -> Statement:
        """What Creo says in a comment, which goes on where its line ends with `$`."""
        text, last = comment.text.rstrip(), comment.line - 1 - chunk.first_line
        lines = 1
        said = _CREO.match(text.upper())
        while text.endswith(b"$") and last + 1 < len(chunk.line_start):
            last, lines = last + 1, lines + 1
            text = text[:-1] + chunk.raw(last).rstrip()
        known = said is not None and said[1] == b"CSYS"
        body = text[text.find(b"/") :] if known else b"/1,0,0,0,0,1,0,0,0,0,1,0"
        statement = Statement(comment.line, comment.begin, comment.end, b"$$" + body, None, lines)
        return (
            statement if known else Statement(comment.line, comment.begin, comment.end, b"TITLE", None, lines)
        )


_PER_MINUTE = {b"MMPM": 1.0, b"IPM": MM_PER_INCH, b"PERMIN": 1.0}
_PER_TURN = {b"MMPR": 1.0, b"IPR": MM_PER_INCH, b"PERREV": 1.0}


def feed_of(statement: Statement, unit_mm: float, turns_s: float) -> float:
    """mm/s of a FEDRAT; NaN where it says none that is a speed."""
    value, words = NAN, set()
    for field in statement.fields():
        found = field.number
        if found is None:
            words.add(field.text)
        elif value != value:
            value = found[0] / 10.0 ** found[1]
    for name, scale in _PER_MINUTE.items():
        if name in words:
            return value * (unit_mm if name == b"PERMIN" else scale) / 60.0
    for name, scale in _PER_TURN.items():
        if name in words:
            return value * (unit_mm if name == b"PERREV" else scale) * turns_s if turns_s else NAN
    return NAN if words & {b"INVERSE", b"INVERS"} else value * unit_mm / 60.0


def _axis(x: float, y: float, z: float) -> Vector:
    return (x, y, z) if (x, y) != (0.0, 0.0) or z < 0 else UP


def _summed(value: Array, place: Array, incremental: Mask, at: Sequence[float]) -> Array:
    """(n, 3) ends of points, some of them distances, from `at`."""
    order = np.arange(len(value))
    total = np.cumsum(np.where(incremental[:, None], value, 0.0), axis=0)
    source = np.maximum.accumulate(np.where(~incremental, order, -1))
    from_point = place[source] + (total - total[source])
    return np.asarray(np.where((source >= 0)[:, None], from_point, np.array(at) + total), float)


def shown(text: bytes) -> str:
    """Words of a program, for a message."""
    said = text.decode("ascii", "backslashreplace")
    return "".join(c if c.isprintable() else "?" for c in said[:40])
