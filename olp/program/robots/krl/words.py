"""The words of a move of KRL: its target, what stands behind WITH, and how the move ends."""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.krl.text import Line, parts
from olp.program.robots.targets import NOWHERE, Span

#: The words of most moves: a position with its numbers or its name, and how it is passed.
_USUAL = pattern(rb"(?i)\s*(?!C_|WITH\b)(\{[^{}]*\}|[A-Z_]\w*)(?:\s+(C_(?:PTP|DIS|VEL|ORI|SPL)))?\s*")
_TAIL = pattern(
    rb"(?i)\s*(\bWITH\b.*?)?(?:\s*\b(C_(?:PTP|DIS|VEL|ORI|SPL)(?:\s+C_(?:PTP|DIS|VEL|ORI))?))?\s*"
)
_TARGET = pattern(rb"(?i)(?:\{[^{}]*\}|[^{}])*?(?=\s*(?:\bC_(?:PTP|DIS|VEL|ORI|SPL)\b|\bWITH\b|$))")


@dataclass(frozen=True, slots=True)
class Words:
    """The bytes of the `target` of a move, of the operands in it (`terms`), of what stands behind WITH, and
    of the words that say how the move ends (`zone`)."""

    target: Span
    terms: list[Span]
    within: Span
    zone: Span


def words_of(data: bytes, begin: int, line: Line) -> Words:
    """The words of a move whose name ends at byte `begin`. Raises ProgramError where they are not read."""
    usual = _USUAL.fullmatch(data, begin, line.end)
    if usual is not None:
        target = usual.span(1)
        return Words(target, [target], NOWHERE, usual.span(2))
    stated = _TARGET.match(data, begin, line.end)
    tail = None if stated is None else _TAIL.fullmatch(data, stated.end(), line.end)
    if stated is None or tail is None or not stated[0].strip():
        raise ProgramError("the words of this move are not read", line=line.line, code="OLP516")
    target = stated.start() + len(stated[0]) - len(stated[0].lstrip()), stated.end()
    return Words(target, parts(data, target), tail.span(1), tail.span(2))
