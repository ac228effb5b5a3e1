"""Arcs of robot programs as they are written: an arc again where one keeps to the corrected path, else the
fewest arcs that do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.arcs import Bent
from olp.program.robots.dialect import Replacement, RobotDialect
from olp.program.robots.targets import Arc, Part, Use

#: The share of a tolerance that arcs take.
SHARE = 0.7


@dataclass(frozen=True, slots=True)
class Piece:
    """An arc of several in place of one: the chords, counted from 0, behind which its via point and its end
    are."""

    via: int
    end: int


def stepped(line: int) -> ProgramError:
    """The refusal of an arc on which backlash is taken up."""
    return ProgramError(
        "an axis turns round on this arc, and its backlash is taken up by a step, which an arc cannot have; "
        "post straight moves",
        line=line,
        code="OLP561",
    )


def pieces_of(arc: Arc, bent: Bent, line: int) -> list[Piece]:
    """The arcs in place of one; none where the statement stays with other numbers. Raises ProgramError where
    it may not be split, or no number of arcs keeps to the path."""
    found = bent.arcs()
    if found is None:
        raise ProgramError(
            "no number of arcs in place of this one keeps the path within tolerance; raise --tolerance-um or "
            "--tolerance-urad",
            line=line,
            code="OLP566",
        )
    if len(found) == 1:
        return []
    if arc.whole:
        raise ProgramError(
            "this arc would be split to stay within tolerance, and what is said beside it belongs to all of "
            "it; post it as shorter arcs",
            line=line,
            code="OLP561",
        )
    return [Piece(via - 1, end - 1) for via, end in found]


def stated(program: Program, arc: Arc, piece: Piece, part: Callable[[int, int], Part]) -> list[Replacement]:
    """What states one of the arcs in place of an `arc`. The last of them is stated by the end of that. `part`
    is a point of the path behind a chord, counted from 0, with the words of a move."""
    dialect, targets = program.dialect, program.targets
    assert isinstance(dialect, RobotDialect)
    assert targets is not None

    def point(of: int, chord: int) -> tuple[Use, Part]:
        own, there = targets.uses[of], targets.uses[arc.first + chord]
        assert own is not None
        assert there is not None
        return replace(own, turn=there.turn, before=there.turn), part(chord, of)

    via = point(arc.middle, piece.via)
    last = arc.first + piece.end == arc.last
    return dialect.arc(program, arc.last, via, None if last else point(arc.last, piece.end))
