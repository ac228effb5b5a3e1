"""Reads programs in languages that a file describes.

Nothing is guessed: a statement that no form of the dialect matches is an error with its line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.machine import ZERO, Setup
from olp.core.toolpath import Flag, Kind
from olp.core.values import dataclass
from olp.program.described.language import Rule, UserDialect
from olp.program.described.lines import Line, SameForm, Text, same_form_of
from olp.program.dialect import Dialect, Options
from olp.program.frame_index import frame_index
from olp.program.frames import FrameTable
from olp.program.program import Program
from olp.program.text.delimited import MM, MM_S
from olp.program.text.numbers import number
from olp.program.verbatim import Moves

NAN = float("nan")
_AXES = ("x", "y", "z")
_TURNS = ("a", "b", "c")
_NO_DIGITS = str.maketrans("", "", "0123456789.")
#: characters; the time to compare a statement with its forms may go with the square of its length
_LONGEST_STATEMENT = 4000
_FIRST = re.compile(r"\s*([\w.$#%]*)")


@dataclass(slots=True)
class _Point:
    """A named position: its numbers, and their words; `twice` is the line that defines it again."""

    line: int
    slots: tuple[int, ...]
    values: tuple[float, ...]
    unit_mm: float
    turn: tuple[float, ...]
    twice: int = 0


def read_described(
    data: bytes, setup: Setup, dialect: Dialect, options: Options | None = None, *, words: bool = True
) -> Program:
    """Read a program. Raises ProgramError with the line of the first statement that cannot be read
    correctly."""
    assert isinstance(dialect, UserDialect)
    return _Reader(data, setup, dialect).run(words=words)


@dataclass(slots=True)
class _SimilarLines:
    """A stretch of lines (from 0) that are similar to others before them, and the form of each."""

    line: list[int]
    form: list[SameForm]


_Item = tuple[Line, Rule, "re.Match[str]"] | _SimilarLines


def _turn(fields: Mapping[str, str | None]) -> tuple[float, ...]:
    """The orientation that a statement states."""
    return tuple(float(number_text) for a in _TURNS if (number_text := fields.get(a)))


class _Reader:
    """Reads one program."""

    def __init__(self, data: bytes, setup: Setup, dialect: UserDialect) -> None:
        self.data, self.setup, self.dialect = data, setup, dialect
        self.moves = Moves()
        self.numbered = dialect.numbered
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
        self.known_frames: dict[tuple[str, int | None, float], int] = {}
        self.position: list[float] = [NAN if v is None else v for v in setup.job.start_mm]
        self.turns: dict[tuple[float, ...], int] = {}
        #: how many parts the text has had, and the part and the line of the first move
        self.sections = 0
        self.moved: tuple[int, int] | None = None

    def run(self, *, words: bool) -> Program:
        if self.data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ProgramError(
                "the text is UTF-16; expected one byte per character; save it as plain text",
                line=1,
                code="OLP502",
            )
        text = Text(self.data)
        items = self._matched(text)
        unit = self.unit
        for item in items:
            if isinstance(item, _SimilarLines):
                continue
            line, rule, match = item
            if rule.does == "point":
                self._point(line, match)
            elif rule.does == "unit":
                self.unit = rule.unit
        self.unit = unit
        for item in items:
            if isinstance(item, _SimilarLines):
                self._put_similar(text, item)
            else:
                self._statement(*item)
        return self._program(words=words)

    def _matched(self, text: Text) -> list[_Item]:
        """Statements with their rules, and stretches of similar lines, in order."""
        items: list[_Item] = []
        known: dict[str, dict[bytes, SameForm | None]] = {}
        open_: _SimilarLines | None = None
        plain, count, places, keys = text.plain, text.count, text.places, text.keys
        here = known.setdefault(self.section, {})
        index = 0
        while index < len(keys):
            form = here.get(keys[index])
            if (
                form is not None
                and plain[index]
                and form.count == count[index]
                and form.places == places[index]
            ):
                if open_ is None:
                    open_ = _SimilarLines([], [])
                    items.append(open_)
                open_.line.append(index)
                open_.form.append(form)
                index += 1
                continue
            line, behind = text.statement(index, self.dialect)
            if line is not None:
                open_ = None
                bare, rule, match = self._rule(line)
                items.append((bare, rule, match))
                if keys[index] not in here and rule.enters is None and self._varies(match):
                    here[keys[index]] = same_form_of(text, line, bare, rule, match)
                here = known.setdefault(self.section, {})
            index = behind
        return items

    def _varies(self, match: re.Match[str]) -> bool:
        """Whether the statement keeps its meaning with other numbers."""
        first = _FIRST.match(match[0])
        word = (first[1] if first else "").upper().translate(_NO_DIGITS)
        return self.numbered is not None and word not in self.numbered

    def _put_similar(self, text: Text, similar: _SimilarLines) -> None:
        """Put the moves of similar lines, all at once."""
        lines, which = np.array(similar.line), np.array([id(form) for form in similar.form])
        count = len(lines)
        pick = np.zeros((count, 3), np.int64)
        feed, says = np.full(count, NAN), np.zeros(count, bool)
        begin, end = np.zeros(count, np.int64), np.zeros(count, np.int64)
        kind = np.zeros(count, np.uint8)
        token, value = text.token[lines], text.value
        for name, form in {id(form): form for form in similar.form}.items():
            rows = np.flatnonzero(which == name)
            first = token[rows]
            assert (text.offset[first[:, None] + np.arange(form.count)] == np.array(form.offset)).all()
            pick[rows] = first[:, None] + np.array(form.xyz)
            before = text.last[first + form.label - 1] if form.label else text.start[lines[rows]]
            begin[rows], end[rows] = before + form.gap, text.last[first + form.count - 1] + form.rest
            kind[rows] = Kind.LINE if form.rule.does == "line" else Kind.RAPID
            if form.speed >= 0:
                says[rows] = True
                unit = form.rule.speed_unit or self.dialect.speed_unit
                feed[rows] = value[first + form.speed] * (MM_S[unit] if unit is not None else NAN)
            if form.turn:
                turn = value[first[:, None] + np.array(form.turn)]
                for row in (0, int((turn != turn[0]).any(axis=1).argmax())):
                    self.turns.setdefault(tuple(turn[row].tolist()), int(lines[rows[row]]) + 1)
        source = np.maximum.accumulate(np.where(says, np.arange(count), -1))
        feed = np.where(source >= 0, feed[source], self.feed)
        self.feed = float(feed[-1])
        self._put_all(text, lines + 1, kind, pick, np.column_stack((begin, end)), feed)

    def _put_all(
        self, text: Text, line: Index, kind: npt.NDArray[np.uint8], pick: Index, bounds: Index, feed: Array
    ) -> None:
        """Put moves of one frame: (n,) lines from 1, (n, 3) the numbers of the text that state each."""
        first, count = int(line[0]), len(line)
        unit_mm = self._unit_mm(first)
        frame = self._frame(first, unit_mm)
        self._note_move(first)
        where = self.table.frames[frame]
        stated = text.value[pick] * unit_mm
        turned = stated if where.turn is None else stated @ np.array(where.turn).T
        axis_mm = turned + np.array(where.offset_mm)
        self.moves.put_all(
            kind=kind, flag=np.zeros(count), line=line, frame=np.full(count, frame), end=axis_mm,
            slot=self.moves.number_count + np.arange(3 * count), bounds=bounds, feed=feed,
            spans=np.column_stack((text.first[pick.ravel()], text.last[pick.ravel()])),
        )  # fmt: skip
        self.position = axis_mm[-1].tolist()

    def _rule(self, line: Line) -> tuple[Line, Rule, re.Match[str]]:
        """A statement without its label, its rule and its fields; follows the sections. Raises ProgramError
        where there is no rule."""
        text, dialect = line.text, self.dialect
        if len(text) > _LONGEST_STATEMENT:
            raise ProgramError(
                f"the statement has {len(text)} characters; expected at most {_LONGEST_STATEMENT}",
                line=line.number,
                code="OLP505",
            )
        last = stop = len(text.rstrip())
        if dialect.terminator and text[:stop].endswith(dialect.terminator):
            stop -= len(dialect.terminator)
        start = 0
        if dialect.label is not None and (label := dialect.label.match(text, 0, stop)):
            start = label.end()
        first = _FIRST.match(text, start, stop)
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
            f"`{text.strip()[:60]}` is not a statement of the dialect {dialect.name}, and may move the "
            "machine; describe it in the dialect file, or take it out",
            line=line.number,
            code="OLP510",
        )

    def _statement(self, line: Line, rule: Rule, match: re.Match[str]) -> None:
        fields = match.groupdict()
        if rule.does == "refuse":
            raise ProgramError(
                f"`{line.text.strip()[:60]}` is not read: {rule.why or 'it may move the machine'}",
                line=line.number,
                code="OLP512",
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
        """A speed in mm/s, NaN where it has no unit of speed."""
        unit = rule.speed_unit or self.dialect.speed_unit
        speed = fields.get("speed")
        return float(speed) * MM_S[unit] if speed is not None and unit is not None else NAN

    @staticmethod
    def _integer(line: Line, text: str) -> int:
        if not text.isdigit():
            raise ProgramError(
                f"tool {text} is not a tool number; expected an integer", line=line.number, code="OLP516"
            )
        return int(text)

    def _unit_mm(self, line: int) -> float:
        if self.unit is None:
            raise ProgramError(
                "no unit is stated before this position; give the key unit in the dialect file",
                line=line,
                code="OLP516",
            )
        return MM[self.unit]

    # -- positions -----------------------------------------------------------------------------------

    def _slots(self, line: Line, match: re.Match[str]) -> tuple[list[int], list[float]]:
        """Words and values of the axes that a statement states; -1 and NaN where it leaves one out."""
        slots, values = [], []
        for axis in _AXES:
            digits = match.groupdict().get(axis)
            if digits is None:
                slots.append(-1)
                values.append(NAN)
                continue
            start, end = (line.place(match.start(axis)), line.place(match.end(axis) - 1) + 1)
            form = number(self.data[start:end])
            if form is None:
                raise ProgramError(
                    f"the number {digits} goes on in another line; write it in one line",
                    line=line.number,
                    code="OLP510",
                )
            slots.append(self.moves.number(start, end))
            values.append(form.value)
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
        self.points[name] = _Point(line.number, tuple(slots), tuple(values), self._unit_mm(line.number), turn)

    def _name(self, text: str) -> str:
        return text.upper() if self.dialect.ignore_case else text

    def _move(self, line: Line, rule: Rule, match: re.Match[str]) -> None:
        fields = match.groupdict()
        inline = fields.get("target") is None
        if inline:
            slots, values = self._slots(line, match)
            unit, turn = self._unit_mm(line.number), _turn(fields)
        else:
            point = self._target(line, fields["target"])
            slots, values, unit, turn = list(point.slots), list(point.values), point.unit_mm, point.turn
        frame = self._frame(line.number, unit)
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
        """Where a move ends, as axis positions; an axis that is left out does not move."""
        where = self.table.frames[frame]
        omitted = [v != v for v in values]
        if incremental:
            step = replace(where, offset_mm=ZERO).placed_mm([0.0 if v != v else v for v in values])
            return [p + s for p, s in zip(self.position, step, strict=True)]
        if any(omitted):
            now = where.tip_mm(np.array([self.position]) - np.array(where.length_mm))[0] / where.unit_mm
            values = [float(n) if v != v else v for n, v in zip(now, values, strict=True)]
            if where.turn is None:
                placed = where.placed_mm(values)
                return [p if gone else q for p, q, gone in zip(self.position, placed, omitted, strict=True)]
        return list(where.placed_mm(values))

    def _target(self, line: Line, text: str) -> _Point:
        point = self.points.get(self._name(text))
        if point is None:
            raise ProgramError(
                f"the position {text} is not defined in this text; "
                "add its definition, or correct the list of positions that has it",
                line=line.number,
                code="OLP533",
            )
        if point.twice:
            raise ProgramError(
                f"the position {text} is defined twice, in lines {point.line} and {point.twice}, "
                "so which one holds here depends on the run; give each its own name",
                line=line.number,
                code="OLP533",
            )
        return point

    def _frame(self, line: int, unit_mm: float) -> int:
        key = (self.frame_name, self.tool, unit_mm)
        index = self.known_frames.get(key)
        if index is None:
            index = frame_index(self.table, self.setup, self.frame_name, self.tool, unit_mm, line)
            self.known_frames[key] = index
        return index

    def _note_move(self, line: int) -> None:
        """Note a move: in which part of the text it is, and whether a statement has named its frame."""
        first = self.moved = self.moved or (self.sections, line)
        if not self.framed and self.assumed is None:
            self.assumed = line
        if first[0] != self.sections:
            raise ProgramError(
                f"this text has moves in two parts, here and from line {first[1]} on, "
                "and their order is not known; put each part into its own file",
                line=line,
                code="OLP532",
            )

    def _put(
        self, line: Line, kind: Kind, flag: Flag, end: list[float], slots: tuple[int, ...], *, inline: bool,
        frame: int | None = None,
    ) -> None:  # fmt: skip
        self.position = list(end)
        self.moves.put(
            kind=int(kind), flag=int(flag), line=line.number,
            frame=self._frame(line.number, self._unit_mm(line.number)) if frame is None else frame, end=end,
            slot=slots, bounds=(line.begin, line.end) if inline else (-1, -1), feed=self.feed,
        )  # fmt: skip
        self._note_move(line.number)

    # -- the end -------------------------------------------------------------------------------------

    def _program(self, *, words: bool) -> Program:
        moves, data = self.moves, self.data
        remarks = []
        if self.assumed is not None:
            remarks.append(
                ("told", self.assumed, f"positions are stated in {self.setup.machine.default_work_offset}")
            )
        if len(self.turns) > 1:
            remarks.append(
                ("turning", list(self.turns.values())[1], "the orientation changes from move to move")
            )
        return moves.program(
            data, self.dialect, self.setup, self.table.frames, remarks, decimal=b".", words=words
        )
