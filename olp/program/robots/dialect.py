"""What a language of robots gives beside a dialect of statements: how new targets and new moves are said."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.values import dataclass
from olp.program.dialect import StatementDialect
from olp.program.program import Program
from olp.program.robots.targets import Target, Use


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotDialect(StatementDialect):
    """A language of robots. `decimals` are the fewest of a number that is changed, `longest_name` the
    characters that a name may have."""

    decimals: int
    longest_name: int

    def stamp_place(self, data: bytes) -> int:
        """Where the stamp of a correction is put as a line of its own."""
        raise NotImplementedError

    def part(
        self, program: Program, move: int, use: Use, numbers: Sequence[bytes], share: float, *, stop: bool
    ) -> bytes:
        """The statements of a part of a move that ends at a share of it, with or without a `stop` there, with
        the line end and the blanks that come before the move itself."""
        raise NotImplementedError

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> tuple[int, bytes]:
        """The declaration of a target again, under another name and with another value; and where it is
        put."""
        raise NotImplementedError
