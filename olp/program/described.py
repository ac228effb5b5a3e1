"""Reads line-oriented languages of motion that a file describes: forms of statements, and what each does.

Nothing is guessed: a statement that no form of the dialect matches refuses the program with its line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from olp.exceptions import ProgramError
from olp.machine import ZERO, Setup
from olp.program.delimited import MM, MM_S
from olp.program.dialect import Dialect, Options, Row, Support
from olp.program.forms import Form
from olp.program.frames import FrameTable
from olp.program.lettered import Moves
from olp.program.numbertext import number
from olp.program.places import frame_index
from olp.program.program import Program
from olp.toolpath import Flag, Kind

NAN = float("nan")
_AXES = ("x", "y", "z")
_TURNS = ("a", "b", "c")

#: what a statement may do, and what becomes of it
DOES = {
    "line": (Support.CORRECTED, "a straight move"),
    "rapid": (Support.CORRECTED, "a move whose way is not stated; corrected at its end"),
    "point": (Support.CORRECTED, "a named position; corrected where moves use it"),
    "away": (Support.READ, "moves the machine where the text does not say"),
    "tool": (Support.READ, "the tool from here on"),
    "frame": (Support.READ, "the frame from here on"),
    "unit": (Support.READ, "the unit from here on"),
    "speed": (Support.READ, "the speed from here on, where it is stated in a unit of speed"),
    "section": (Support.READ, "begins or ends a part of the text"),
    "carry": (Support.CARRIED, ""),
    "refuse": (Support.REFUSED, ""),
}


@dataclass(frozen=True, slots=True)
class Rule:
    """One form and what its statements do. `inside` is the section where it holds (None: in all), `enters`
    the one that it begins; `frame` and `unit` are fixed by the form where it has no field for them."""

    form: Form
    does: str
    why: str = ""
    inside: str | None = None
    enters: str | None = None
    frame: str | None = None
    unit: str | None = None
    speed_unit: str | None = None
    incremental: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class UserDialect(Dialect):
    """A language that a file describes."""

    family: str = "described"
    statements: tuple[Rule, ...]
    unit: str | None
    speed_unit: str | None = None
    comments: tuple[str, ...] = ()
    quote: str = ""
    continuation: str = ""
    terminator: str = ""
    label: re.Pattern[str] | None = None
    ignore_case: bool = True
    about: str = ""
    by_word: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)

    def rows(self) -> Sequence[Row]:
        out = []
        for rule in self.statements:
            support, usual = DOES[rule.does]
            where = f" (in {rule.inside})" if rule.inside else ""
            out.append(Row(rule.form.text + where, support, rule.why or usual))
        return [*out, Row("any other statement", Support.REFUSED, "it may move the machine")]


@dataclass(frozen=True, slots=True)
class Line:
    """A statement: its first line from 1, its text without comment, and where each character is in the
    bytes."""

    number: int
    text: str
    at: tuple[tuple[int, int], ...]
    begin: int
    end: int

    def place(self, index: int) -> int:
        for first, start in reversed(self.at):
            if index >= first:
                return start + index - first
        return self.begin


@dataclass(slots=True)
class _Point:
    """A named position: its numbers, and where they stand; `twice` where the text says it again."""

    line: int
    slots: tuple[int, ...]
    values: tuple[float, ...]
    unit_mm: float
    turn: tuple[float, ...]
    twice: int = 0


def read_described(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a program. Raises ProgramError with the line of the first statement that cannot be read right."""
    assert isinstance(dialect, UserDialect)
    return _Reader(data, setup, dialect).run(words=words)


def lines_of(data: bytes, dialect: UserDialect) -> Iterator[Line]:
    """The statements of a text: comments off, continued lines joined."""
    text, at, number_, begin = "", [], 0, 0
    position = 3 if data[:3] == b"\xef\xbb\xbf" else 0
    for count, raw in enumerate(data[position:].splitlines(keepends=True), 1):
        body = raw.rstrip(b"\r\n").decode("latin-1")
        start, position = position, position + len(raw)
        code = _without_comment(body, dialect)
        kept = code.rstrip()
        goes_on = bool(dialect.continuation) and kept.endswith(dialect.continuation)
        if not text:
            number_, begin = count, start
        at.append((len(text), start))
        text += kept[: -len(dialect.continuation)] + " " if goes_on else code
        if goes_on:
            continue
        if text.strip():
            yield Line(number_, text, tuple(at), begin, start + len(body))
        text, at = "", []
    if text.strip():
        yield Line(number_, text, tuple(at), begin, position)


def _without_comment(body: str, dialect: UserDialect) -> str:
    first = min((p for mark in dialect.comments if (p := body.find(mark)) >= 0), default=-1)
    if first < 0 or not dialect.quote or dialect.quote not in body[:first]:
        return body if first < 0 else body[:first]
    quoted = False
    for i, letter in enumerate(body):
        if letter == dialect.quote:
            quoted = not quoted
        elif not quoted and any(body.startswith(mark, i) for mark in dialect.comments):
            return body[:i]
    return body


def _turn(fields: Mapping[str, str | None]) -> tuple[float, ...]:
    """The orientation that a statement says."""
    return tuple(float(said) for a in _TURNS if (said := fields.get(a)))


class _Reader:
    """One reading of one program."""

    def __init__(self, data: bytes, setup: Setup, dialect: UserDialect) -> None:
        self.data, self.setup, self.dialect = data, setup, dialect
        self.out = Moves()
        self.points: dict[str, _Point] = {}
        self.section = ""
        self.unit = dialect.unit
        self.frame_name = setup.machine.default_work_offset
        #: whether a statement has named a frame, and the line of the first move without one
        self.framed = False
        self.assumed: int | None = None
        self.tool: int | None = None
        self.feed = NAN
        self.table = FrameTable(setup)
        self.position: list[float] = [NAN if v is None else v for v in setup.job.start_mm]
        self.turns: dict[tuple[float, ...], int] = {}
        #: how many parts the text has had, and where the first moves stand
        self.sections = 0
        self.moved: tuple[int, int] | None = None

    def run(self, *, words: bool) -> Program:
        if self.data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError(
                "the text is UTF-16; expected one byte a character; save it as plain text", line=1
            )
        found = [self._rule(line) for line in lines_of(self.data, self.dialect)]
        unit = self.unit
        for line, rule, match in found:
            if rule.does == "point":
                self._point(line, match)
            elif rule.does == "unit":
                self.unit = rule.unit
        self.unit = unit
        for line, rule, match in found:
            self._statement(line, rule, match)
        return self._program(words=words)

    def _rule(self, line: Line) -> tuple[Line, Rule, re.Match[str]]:
        """A statement without its label, its rule and its fields; follows the sections. Raises ProgramError
        where there is no rule."""
        text, dialect = line.text, self.dialect
        last = stop = len(text.rstrip())
        if dialect.terminator and text[:stop].endswith(dialect.terminator):
            stop -= len(dialect.terminator)
        start = 0
        if dialect.label is not None and (label := dialect.label.match(text, 0, stop)):
            start = label.end()
        first = re.compile(r"\s*([\w.$#%]*)").match(text, start, stop)
        word = (first[1] if first else "").upper() if dialect.ignore_case else (first[1] if first else "")
        for rule in dialect.by_word.get(word, dialect.by_word[""]):
            if rule.inside is not None and rule.inside != self.section:
                continue
            match = rule.form.pattern.fullmatch(text, start, stop)
            if match is None:
                continue
            if rule.enters is not None:
                self.section = rule.enters
            bare = replace(line, begin=line.place(start), end=line.place(last - 1) + 1)
            return bare, rule, match
        raise ProgramError(
            f"`{text.strip()[:60]}` is no statement that the dialect {dialect.name} knows, and it may move "
            "the "
            "machine; describe it in the dialect file, or take it out",
            line=line.number,
        )

    def _statement(self, line: Line, rule: Rule, match: re.Match[str]) -> None:
        fields = match.groupdict()
        if rule.does == "refuse":
            raise ProgramError(
                f"`{line.text.strip()[:60]}` is not read: {rule.why or 'it may move the machine'}",
                line=line.number,
            )
        if rule.does == "unit":
            self.unit = rule.unit
        elif rule.does == "frame":
            self.framed = True
            self.frame_name = fields.get("frame") or rule.frame or self.setup.machine.default_work_offset
        elif rule.does == "tool":
            self.tool = self._integer(line, fields.get("tool") or "0")
        elif rule.does == "speed":
            self.feed = self._speed(rule, fields)
        elif rule.does == "section":
            self.sections += 1
        elif rule.does == "away":
            self._put(line, Kind.RAPID, Flag.CONTROL, [NAN] * 3, (-1, -1, -1), inline=False)
        elif rule.does in ("line", "rapid"):
            self._move(line, rule, match)

    def _speed(self, rule: Rule, fields: Mapping[str, str | None]) -> float:
        """A speed in mm/s, NaN where it is none in a unit of speed."""
        unit = rule.speed_unit or self.dialect.speed_unit
        said = fields.get("speed")
        return float(said) * MM_S[unit] if said is not None and unit is not None else NAN

    @staticmethod
    def _integer(line: Line, text: str) -> int:
        if not text.isdigit():
            raise ProgramError(f"tool {text} is no tool number; expected a whole number", line=line.number)
        return int(text)

    def _unit_mm(self, line: Line) -> float:
        if self.unit is None:
            raise ProgramError(
                "no unit is stated before this position; give the key unit in the dialect file",
                line=line.number,
            )
        return MM[self.unit]

    # -- positions -----------------------------------------------------------------------------------

    def _slots(self, line: Line, match: re.Match[str]) -> tuple[list[int], list[float]]:
        """Words and values of the axes that a statement says; -1 and NaN where it leaves one out."""
        slots, values = [], []
        for axis in _AXES:
            said = match.groupdict().get(axis)
            if said is None:
                slots.append(-1)
                values.append(NAN)
                continue
            start, end = (line.place(match.start(axis)), line.place(match.end(axis) - 1) + 1)
            form = number(self.data[start:end])
            if form is None:
                raise ProgramError(
                    f"the number {said} goes on in another line; write it in one", line=line.number
                )
            slots.append(len(self.out.numbers))
            values.append(form.value)
            self.out.numbers.append(form)
            self.out.spans.append((start, end))
        return slots, values

    def _point(self, line: Line, match: re.Match[str]) -> None:
        fields = match.groupdict()
        name = self._name(fields["target"])
        before = self.points.get(name)
        if before is not None:
            before.twice = line.number
            return
        slots, values = self._slots(line, match)
        turn = _turn(fields)
        self.points[name] = _Point(line.number, tuple(slots), tuple(values), self._unit_mm(line), turn)

    def _name(self, text: str) -> str:
        return text.upper() if self.dialect.ignore_case else text

    def _move(self, line: Line, rule: Rule, match: re.Match[str]) -> None:
        fields = match.groupdict()
        inline = fields.get("target") is None
        if inline:
            slots, values = self._slots(line, match)
            unit, turn = self._unit_mm(line), _turn(fields)
        else:
            point = self._target(line, fields["target"])
            slots, values, unit, turn = list(point.slots), list(point.values), point.unit_mm, point.turn
        frame = self._frame(line, unit)
        end = self._end(frame, values, incremental=rule.incremental)
        flag = Flag.INCREMENTAL if rule.incremental else Flag(0)
        if rule.does == "line" and (not inline or -1 in slots):
            flag |= Flag.WHOLE
        if turn:
            self.turns.setdefault(turn, line.number)
        kind = Kind.LINE if rule.does == "line" else Kind.RAPID
        if fields.get("speed") is not None:
            self.feed = self._speed(rule, fields)
        self._put(line, kind, flag, end, tuple(slots), inline=inline, frame=frame)

    def _end(self, frame: int, values: list[float], *, incremental: bool) -> list[float]:
        """Where a move ends, as axis positions; an axis that is left out stays."""
        where = self.table.frames[frame]
        left = [v != v for v in values]
        if incremental:
            step = replace(where, offset_mm=ZERO).placed_mm([0.0 if v != v else v for v in values])
            return [p + s for p, s in zip(self.position, step, strict=True)]
        if any(left):
            now = where.tip_mm(np.array([self.position]) - np.array(where.length_mm))[0] / where.unit_mm
            values = [float(n) if v != v else v for n, v in zip(now, values, strict=True)]
            if where.turn is None:
                placed = where.placed_mm(values)
                return [p if gone else q for p, q, gone in zip(self.position, placed, left, strict=True)]
        return list(where.placed_mm(values))

    def _target(self, line: Line, text: str) -> _Point:
        point = self.points.get(self._name(text))
        if point is None:
            raise ProgramError(
                f"the position {text} is not in this text; put its definition in, or correct the list of "
                "positions that holds it",
                line=line.number,
            )
        if point.twice:
            raise ProgramError(
                f"the position {text} is defined in line {point.line} and again in line {point.twice}, so "
                "which "
                "one holds here depends on the run; give each its own name",
                line=line.number,
            )
        return point

    def _frame(self, line: Line, unit_mm: float) -> int:
        return frame_index(self.table, self.setup, self.frame_name, self.tool, unit_mm, line.number)

    def _put(
        self, line: Line, kind: Kind, flag: Flag, end: list[float], slots: tuple[int, ...], *, inline: bool,
        frame: int | None = None,
    ) -> None:  # fmt: skip
        out = self.out
        self.position = list(end)
        out.kind.append(int(kind))
        out.flag.append(int(flag))
        out.line.append(line.number)
        out.frame.append(self._frame(line, self._unit_mm(line)) if frame is None else frame)
        out.end.append(tuple(end))
        out.slot.append(slots)
        out.feed.append(self.feed)
        out.bounds.append((line.begin, line.end) if inline else (-1, -1))
        first = self.moved = self.moved or (self.sections, line.number)
        if not self.framed and self.assumed is None:
            self.assumed = line.number
        if first[0] != self.sections:
            raise ProgramError(
                f"moves stand in two parts of this text, here and from line {first[1]} on, and which of them "
                "runs when is not known; give each part a file of its own",
                line=line.number,
            )

    # -- the end -------------------------------------------------------------------------------------

    def _program(self, *, words: bool) -> Program:
        out, data = self.out, self.data
        remarks = []
        if self.assumed is not None:
            remarks.append(
                ("told", self.assumed, f"positions are stated in {self.setup.machine.default_work_offset}")
            )
        if len(self.turns) > 1:
            remarks.append(
                ("turning", list(self.turns.values())[1], "the orientation changes from move to move")
            )
        return out.program(
            data, self.dialect, self.setup, self.table.frames, remarks, decimal=b".", words=words
        )
