"""KRL as a dialect: how a corrected program says new positions and moves."""

from __future__ import annotations

from math import radians

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import InPlace, Replacement
from olp.program.robots.krl import postures
from olp.program.robots.krl.data import is_declaration
from olp.program.robots.krl.reader import read
from olp.program.robots.krl.table import TABLE
from olp.program.robots.krl.text import aggregate
from olp.program.robots.poses import between, zyx_of
from olp.program.robots.targets import NOWHERE, Part, Target, Use
from olp.program.text.numbers import spliced
from olp.program.text.signs import KRL

_ROUTINE = pattern(rb"(?im)^[ \t]*(?:GLOBAL[ \t]+)?DEF(?:FCT)?\b[^\r\n]*(?:\r\n|\n|\r|\Z)")
_HEADER = pattern(rb"(?:\xef\xbb\xbf)?(?:&[^\r\n]*(?:\r\n|\n|\r|\Z))*")
_WORD = pattern(rb"(?i)(S?)(LIN|PTP|CIRC)")
_TYPE = pattern(rb"(?i)((?:(?:GLOBAL|DECL|CONST)\s+)*)(E6POS|E3POS|POS|FRAME|E6AXIS|E3AXIS|AXIS)\b")
#: The words with which a part is passed without a stop.
_PASSED = {
    b"LIN": b"C_DIS", b"PTP": b"C_PTP", b"CIRC": b"C_DIS", b"SLIN": b"C_SPL", b"SPTP": b"C_SPL",
    b"SCIRC": b"C_SPL",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Krl(InPlace):
    """KRL programs."""

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _ROUTINE.search(program.data) or _HEADER.match(program.data)
        assert match is not None
        return match.end(), match.end(), stamp + program.eol(1)

    def again(
        self, program: Program, move: int, use: Use, edits: list[Replacement], *, stop: bool
    ) -> Replacement:
        word = _WORD.match(program.data, use.statement[0])
        assert word is not None
        close = b"" if stop else b" " + _PASSED[word[0].upper()]
        return self.parted(program, move, use, [*edits, *self._unzoned(program, use)], close)

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        data, (begin, end) = program.data, target.declaration
        if not is_declaration(data[begin:end]):
            raise ProgramError(
                f"{target.name} is assigned by a statement, and its moves want different numbers of it, or a "
                "base or another move needs it as it is; give each move its own position",
                line=target.line,
                code="OLP561",
            )
        head = _TYPE.match(data, begin, end)
        assert head is not None
        blanks = data[int(program.line_start[target.line - 1]) : begin]
        place = int(program.line_end[target.line - 1])
        return place, place, program.eol(target.line) + blanks + head[0] + b" " + name.encode() + b"=" + text

    @staticmethod
    def _unzoned(program: Program, use: Use) -> list[Replacement]:
        """Takes away what says how a move ends, with the blanks before it."""
        if use.zone == NOWHERE:
            return []
        begin = use.statement[0]
        place = begin + len(program.data[begin : use.zone[0]].rstrip())
        return [(place, use.zone[1], b"")]

    def value(self, program: Program, part: Part, use: Use) -> bytes:
        """The position of a move with other numbers, and the orientation at the end of a part."""
        assert program.targets is not None
        target = program.targets.targets[use.target]
        start, numbers = target.value[0], aggregate(program.data, target.value)
        assert numbers is not None
        edits = part.renumbered(target)
        if not part.turned and not (use.before == use.turn == target.turn):
            angles = zyx_of(between(use.before, use.turn, part.share))
            for (a, b), angle in zip(numbers.spans[3:6], angles, strict=True):
                edits.append((a - start, b - start, f"{angle:.6f}".encode()))
        return spliced(program.data[slice(*target.value)], edits)


DIALECT = Krl(
    name="kuka-krl",
    title="KRL (KUKA)",
    path_mode="approximation",
    reader=read,
    signs=KRL,
    folder_endings=("src",),
    comment=(b"; ", b""),
    languages=frozenset(("KUKA KRL",)),
    table=TABLE,
    decimals=5,
    for_arms=True,
    postures=postures,
    turn_decimals=6,
    turn_unit_rad=radians(1.0),
    longest_name=24,
)
