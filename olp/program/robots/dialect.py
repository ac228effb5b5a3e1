"""What a language of robots gives beside a dialect of statements: how new targets and new moves are said."""

from __future__ import annotations

from itertools import count

from olp.core.values import dataclass
from olp.program.dialect import StatementDialect
from olp.program.program import Program
from olp.program.robots.targets import Part, Target, Use

#: Bytes of the text from one position up to another, and what replaces them.
Replacement = tuple[int, int, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotDialect(StatementDialect):
    """A language of robots. `decimals` are the fewest of a number that is changed. With `names_parts` the
    target of a part of a move needs a name. A name has `longest_name` characters at most; None: any number.
    A statement ends with its line, or where the reader says so."""

    decimals: int
    names_parts: bool = False
    longest_name: int | None = None

    def continues(self, line: bytes) -> bool:
        return False

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        """The stamp of a correction as a line of its own."""
        raise NotImplementedError

    def named(self, program: Program, target: Target, taken: set[str]) -> str:
        """A name for a clone of a target that no other has, `taken` in capitals among them."""
        for number in count(1):
            tail = f"_olp{number}"
            room = None if self.longest_name is None else self.longest_name - len(tail)
            name = target.name[:room] + tail
            if name.upper() not in taken:
                return name
        raise AssertionError

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        """What states a part of a move before its end."""
        raise NotImplementedError

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        """The declaration of a target again, under another name and with another value."""
        raise NotImplementedError

    def counted(self, program: Program, blocks: int) -> list[Replacement]:
        """Counts of the text, where so many statements were inserted."""
        return []
