"""TP programs as a dialect: how a corrected program says new positions and moves."""

from __future__ import annotations

from math import radians

from olp.core.patterns import pattern
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import Replacement, RobotDialect, next_number
from olp.program.robots.ls import postures
from olp.program.robots.ls.reader import read
from olp.program.robots.ls.table import TABLE
from olp.program.robots.ls.text import line_count, lines, parts
from olp.program.robots.poses import between, zyx_of
from olp.program.robots.targets import Part, Target, Use
from olp.program.text.numbers import spliced
from olp.program.text.signs import LS

_NUMBERED = pattern(rb"P\[\s*(\d+)")
_HEAD = pattern(rb"(?m)^([ \t]*)(\d*)([ \t]*:)")
_MAIN = pattern(rb"(?im)^[ \t]*/MN[^\r\n]*(?:\r\n|\n|\r|\Z)")
_PLAIN_TAIL = pattern(rb"(?i)\b(?:ACC\s*(?:\d+|R\[[^\]]*\])|PTH\b|Wjnt\b|(?:Ind\.)?EV\s*\d+\s*%)")
_END = pattern(rb"(?i)(\s)(FINE|CNT\s*\d+|CNT\s*R\[[^\]]*\]|CD\d+|CR\d+)?(\s[^;]*)?;")
_TURN = {name: pattern(rb"\b" + name + rb"\s*=\s*([-+]?(?:\d+\.?\d*|\.\d+))") for name in (b"W", b"P", b"R")}
#: Characters that a comment may have.
_LONGEST_COMMENT = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Ls(RobotDialect):
    """TP programs."""

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _MAIN.search(program.data)
        place = 0 if match is None else match.end()
        words = stamp.strip(b"!; ")
        if b"accepted" not in words:
            words = words[: _LONGEST_COMMENT - 1]
        return place, place, b"    :  !" + words.rstrip() + b" ;" + program.eol(1)

    def named(self, program: Program, target: Target, taken: set[str]) -> str:
        return str(next_number(taken, lambda: map(int, _NUMBERED.findall(program.data)), 1))

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        return [self._statement(program, move, use, [(use, part)]), self._declared(program, part, use)]

    def arc(
        self, program: Program, move: int, via: tuple[Use, Part], end: tuple[Use, Part] | None
    ) -> list[Replacement]:
        use, part = via
        own = self._declared(program, part, use)
        if end is None:
            return [(*use.place, part.name.encode()), own]
        return [
            self._statement(program, move, end[0], [via, end]),
            own,
            self._declared(program, end[1], end[0]),
        ]

    @staticmethod
    def _statement(program: Program, move: int, use: Use, ends: list[tuple[Use, Part]]) -> Replacement:
        """The statement of a move to other positions, which the robot passes."""
        data, (begin, end) = program.data, use.statement
        head = _HEAD.match(data[begin:end])
        assert head is not None
        edits = [(own.place[0] - begin, own.place[1] - begin, part.name.encode()) for own, part in ends]
        behind = data[use.place[1] : end]
        ending = _END.search(b" ".join(behind.split(b"\n")))
        assert ending is not None
        kept = b"".join(b" " + word for word in _PLAIN_TAIL.findall(ending[3] or b""))
        close = (b"FINE" if ends[-1][1].stop else b"CNT100") + kept
        lead = spliced(data[begin : use.place[1]], [(0, head.end(2), b" " * head.end(2)), *edits])
        text = lead + behind[: ending.end(1)] + close + b" ;"
        return begin, begin, text + program.eol(int(program.toolpath.line[move]))

    def _declared(self, program: Program, part: Part, use: Use) -> Replacement:
        """The position of a part, in the order of the path: before the one where the move ends."""
        assert program.targets is not None
        target = program.targets.targets[use.target]
        place = target.declaration[0]
        value = _renumbered(self._value(program, target, part, use), part.name)
        return place, place, value + program.eol(target.line)

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        place = target.declaration[1]
        return place, place, program.eol(target.line) + _renumbered(text, name)

    def counted(self, program: Program, blocks: int) -> list[Replacement]:
        data = whole(program.data)
        sections = parts(data)
        stated = line_count(data, sections["ATTR"][0]) if "ATTR" in sections else None
        # one that is wrong says nothing, and stays
        if stated is None or stated[1] != sum(len(lines(data, part)) for part in sections["MN"]):
            return []
        return [(*stated[0], str(stated[1] + blocks).encode())]

    @staticmethod
    def _value(program: Program, target: Target, part: Part, use: Use) -> bytes:
        """A position with other numbers, and the orientation at the end of a part."""
        data, start = program.data, target.value[0]
        edits = part.renumbered(target)
        if not part.turned and not (use.before == use.turn == target.turn):
            angles = zyx_of(between(use.before, use.turn, part.share))
            for name, angle in zip((b"R", b"P", b"W"), angles, strict=True):
                match = _TURN[name].search(data, target.numbers[2][1], target.value[1])
                assert match is not None
                edits.append((match.start(1) - start, match.end(1) - start, f"{angle:.6f}".encode()))
        return spliced(data[slice(*target.value)], edits)


def _renumbered(text: bytes, number: str) -> bytes:
    """A position with another number, and without its name."""
    return b"P[" + number.encode() + text[text.index(b"]") :]


DIALECT = Ls(
    name="fanuc-tp",
    title="TP (FANUC robots)",
    path_mode="CNT",
    reader=read,
    signs=LS,
    folder_endings=("ls",),
    comment=(b"!", b" ;"),
    languages=frozenset(("FANUC TP",)),
    table=TABLE,
    decimals=3,
    names_parts=True,
    for_arms=True,
    postures=postures,
    turn_decimals=6,
    turn_unit_rad=radians(1.0),
)
