"""What every dialect of programs gives: its names, its marks, its table of statements.

A dialect is a value; what reads its text stands in `olp.program.registry`, by `family`. A reading gives a
`Program`: immutable bytes, words, nominal moves, and which word holds which coordinate of which move.
Programs of blocks of words (RS-274) and of whole statements (APT, DMIS, lists) are written by
`olp.compensation.writing`, which needs nothing of the dialect but what is stated here and in the program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True, slots=True)
class Options:
    """How a program is to be read: `block_delete` leaves `/` blocks out; `contour` takes the contour under
    cutter compensation (G41/G42, CUTCOM) as the tool path."""

    block_delete: bool = False
    contour: bool = False


class Support(Enum):
    """What becomes of a statement."""

    CORRECTED = "corrected"  #: its coordinates are edited
    READ = "read"  #: changes how later statements are understood; its bytes are carried
    CARRIED = "carried"  #: means nothing to the path
    REFUSED = "refused"  #: may move the machine in a way that is not read


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the support matrix: a statement, what becomes of it, and why."""

    statement: str
    support: Support
    why: str = ""

    def as_dict(self) -> dict[str, str]:
        return {"statement": self.statement, "support": self.support.value, "why": self.why}


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """A dialect of programs. `family` says which reader takes it; `path_mode` is how the control passes from
    move to move where a program does not say; `inch_decimals` are the decimals of inch programs for a least
    increment of 0.001 mm, `free_digits` those that centres of arcs may have beyond those of positions.
    `marks`: a corrected program says so in a comment.
    `comment` are the marks around a comment, and `first` the beginnings of lines, in capitals, that have to
    stay in front of any other, in their order (`|` between such as stand for each other)."""

    name: str
    title: str
    family: str
    path_mode: str
    inch_decimals: int = 5
    free_digits: int = 1
    comment: tuple[bytes, bytes] = (b"(", b")")
    first: tuple[bytes, ...] = ()
    marks: bool = True

    def rows(self) -> Sequence[Row]:
        """The support matrix, from the table that the reader uses."""
        raise NotImplementedError

    def support(self) -> list[dict[str, str]]:
        """The support matrix as plain data: statement, support, why."""
        return [row.as_dict() for row in self.rows()]


@dataclass(frozen=True, slots=True, kw_only=True)
class StatementDialect(Dialect):
    """A dialect of whole statements: `table` says what becomes of each by its name, and why."""

    table: Mapping[bytes, tuple[Support, str]]

    def rows(self) -> Sequence[Row]:
        return [Row(name.decode(), support, why) for name, (support, why) in self.table.items()]
