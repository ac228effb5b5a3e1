"""INFORM as a dialect: how a corrected job says new positions and moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

from olp.core.arrays import Array, Mask
from olp.core.patterns import pattern
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import Replacement, RobotDialect, next_number
from olp.program.robots.inform import postures
from olp.program.robots.inform.reader import read
from olp.program.robots.inform.table import TABLE
from olp.program.robots.inform.text import added_to, counted, without_repeats
from olp.program.robots.poses import Quaternion, between, zyx_of
from olp.program.robots.targets import Copy, Part, Target, Use
from olp.program.text.numbers import spliced
from olp.program.text.signs import INFORM

_FIRST = pattern(rb"(?im)^[ \t]*NOP\b[^\r\n]*(?:\r\n|\n|\r|\Z)")
_NUMBERED = pattern(r"[BE]?C(\d+)")
_BESIDE = pattern(rb"(?i)(?<!\w)([BE]C)\d+")
#: The name of a position before its numbers.
_OWN_NAME = pattern(rb"(?m)^[ \t]*([BE]?C|P)\d+(?=[ \t]*=)")
#: A move to a point of an arc.
_POINT = pattern(rb"(?i)(?<!\w)MOVC(?=[ \t])")
#: The position level: 0 is a stop, as a level that the run decides may be.
_LEVEL = pattern(rb"(?i)(?<!\w)PL=[^\s]+")
_PASSED_LEVEL = pattern(rb"(?i)(?<!\w)PL=[1-9]\d*(?!\S)")
_POSTURE = pattern(rb"[ \t]*///[ \t]*RCONF[ \t]*([^\r\n]*?)[ \t]*(?=[\r\n])")
#: Characters of a comment, and digits of the number of a position.
_LONGEST_COMMENT = 32
_DIGITS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Inform(RobotDialect):
    """Jobs of INFORM. Taught positions are counted, so further ones go behind the last of them."""

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _FIRST.search(program.data)
        place = 0 if match is None else match.end()
        words = stamp.strip(b"' ")
        if b"accepted" not in words:
            words = words[:_LONGEST_COMMENT]
        return place, place, b"'" + words.rstrip() + program.eol(1)

    def named(self, program: Program, target: Target, taken: set[str]) -> str:
        def stated() -> list[int]:
            return [int(match[1]) for name in taken if (match := _NUMBERED.fullmatch(name))]

        number = next_number(taken, stated, 0)
        digits = len(target.name) - 1 if target.name[:1].upper() == "C" else _DIGITS
        return f"C{number:0{digits}d}"

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        data, (begin, end) = program.data, use.statement
        tail = data[use.place[1] : end]
        if part.stop:
            own, plus, station = _LEVEL.sub(b"", tail).partition(b"+")
            tail = own.rstrip() + b" PL=0" + b"  " * len(plus) + plus + station
        elif _LEVEL.search(tail) and not _PASSED_LEVEL.search(tail):
            tail = _LEVEL.sub(b"PL=1", tail)
        line = int(program.toolpath.line[move])
        # the way to the first point of an arc is straight, and its parts are no points of an arc
        word = _POINT.sub(b"MOVL", data[begin : use.place[0]])
        statement = self._statement(program, line, begin, [(word, part, tail)])
        return [statement, *self._stated(program, use, part, program.eol(line))]

    def arc(
        self, program: Program, move: int, via: tuple[Use, Part], end: tuple[Use, Part] | None
    ) -> list[Replacement]:
        """An arc from where the robot is, which the three points of the next one follow: they are read as one
        run of moves unless another move parts them."""
        (use, part), line = via, int(program.toolpath.line[move])
        own = self._stated(program, use, part, program.eol(line))
        if end is None:
            return [(*use.place, part.name.encode()), *own]
        tail = program.data[use.place[1] : use.statement[1]]
        words = [(b"MOVC ", part, tail), *((word, end[1], tail) for word in (b"MOVC ", b"MOVL ", b"MOVC "))]
        return [
            self._statement(program, line, use.statement[0], words),
            *own,
            *self._stated(program, end[0], end[1], program.eol(line)),
        ]

    @staticmethod
    def _statement(
        program: Program, line: int, begin: int, moves: list[tuple[bytes, Part, bytes]]
    ) -> Replacement:
        """Moves before the statement of a line: what stands before and behind the position of each."""
        blanks, text = program.data[int(program.line_start[line - 1]) : begin], b""
        for word, part, tail in moves:
            name = part.name.encode()
            # each part has axes beside the robot of its own, which stand where those of the move do
            text += word + name + _BESIDE.sub(rb"\g<1>" + name[1:], tail) + program.eol(line) + blanks
        return begin, begin, text

    def _stated(self, program: Program, use: Use, part: Part, eol: bytes) -> list[Replacement]:
        """The position of a part, with those of the axes beside the robot."""
        assert program.targets is not None
        target, number = program.targets.targets[use.target], part.name[1:].encode()
        return [
            self._declared(program, target, part.name, self._value(program, target, part, use)),
            *(_copied(copy, copy.text, number, eol) for copy in target.copy.beside),
        ]

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        return self._declared(program, target, name, text)

    def completed(self, program: Program, edits: list[Replacement], targets: int) -> list[Replacement]:
        """Further positions follow one another, with a line of a header only where one changes."""
        if not targets:
            return edits
        assert program.targets is not None
        copies = [target.copy for target in program.targets.targets]
        added: dict[int, bytes] = dict.fromkeys(
            (c.place for copy in copies for c in (copy, *copy.beside)), b""
        )
        others: list[Replacement] = []
        for begin, end, text in edits:
            # the words of a posture may change there, too
            if begin in added and b"=" in text:
                added[begin] += text
            else:
                others.append((begin, end, text))
        data, counts = whole(program.data), added_to(b"".join(added.values()))
        gathered = [
            (place, place, without_repeats(data[:place], text)) for place, text in added.items() if text
        ]
        # a count that is wrong says nothing, and stays
        raised = [
            (*span, str(count + counts[kind]).encode()) for kind, (span, count) in counted(data).items()
        ]
        return [*gathered, *others, *raised]

    def turn_values(self, turn: Quaternion, stated: Sequence[float]) -> Sequence[float]:
        z, y, x = zyx_of(turn, stated[2])
        return x, y, z

    def fitting(self, config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
        return postures.fitting(config, axes, branches)

    def turn_texts(
        self, program: Program, target: Target, nominal: Sequence[float], corrected: Sequence[float]
    ) -> tuple[bytes, ...]:
        """Lines before and behind a position whose words change: others behind it keep theirs."""
        new = postures.turned(target.config, nominal, corrected)
        if new is None:
            return b"", b""
        value = _posture_before(whole(program.data), target.value[0])
        words = value.split(b",")
        words[: len(new)] = [str(word).encode() for word in new]
        eol = program.eol(target.line)
        return b"///RCONF " + b",".join(words) + eol, eol + b"///RCONF " + value

    @staticmethod
    def _declared(program: Program, target: Target, name: str, text: bytes) -> Replacement:
        """A position with another name, between the lines that it needs where it goes."""
        return _copied(target.copy, text, name[1:].encode(), program.eol(target.line), b"C")

    @staticmethod
    def _value(program: Program, target: Target, part: Part, use: Use) -> bytes:
        """A position with other numbers, and the orientation at the end of a part."""
        start = target.value[0]
        edits = part.renumbered(target)
        if not part.turned and use.before != use.turn:
            angles = zyx_of(between(use.before, use.turn, part.share))[::-1]
            for (a, b), angle in zip(target.turned, angles, strict=True):
                edits.append((a - start, b - start, f"{angle:.4f}".encode()))
        return spliced(program.data[slice(*target.value)], edits)


def _copied(copy: Copy, text: bytes, number: bytes, eol: bytes, kind: bytes = rb"\g<1>") -> Replacement:
    """A declaration with another number, between the lines that it needs where it goes."""
    own = _OWN_NAME.sub(kind + number, text, count=1)
    return copy.place, copy.place, copy.before + own + eol + copy.behind


def _posture_before(data: bytes, place: int) -> bytes:
    """The words of the last line ///RCONF before a position."""
    match = None
    while match is None:
        place = data.rindex(b"RCONF", 0, place)
        begin = max(data.rfind(b"\n", 0, place), data.rfind(b"\r", 0, place)) + 1
        match = _POSTURE.match(data, begin)
    return match[1]


DIALECT = Inform(
    name="yaskawa-inform",
    title="INFORM (Yaskawa Motoman robots)",
    path_mode="position level",
    reader=read,
    signs=INFORM,
    folder_endings=("jbi",),
    comment=(b"'", b""),
    languages=frozenset(("Yaskawa INFORM (JBI)",)),
    table=TABLE,
    decimals=3,
    names_parts=True,
    for_arms=True,
    turn_decimals=4,
    turn_unit_rad=radians(1.0),
    joint_decimals=4,
)
