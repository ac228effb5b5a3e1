"""Which statements of a KRL text may move the robot or set base and tool, and what a block may do."""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.krl.table import STILL
from olp.program.robots.line import Line

_ROUTINE = pattern(rb"(?i)(?:GLOBAL\s+)?DEF(?:FCT\s+\w+(?:\s*\[[^\]]*\])?)?\s+(\w+)\s*\(")
_CALL = pattern(rb"(?i)(?<![#$.\w])([A-Z]\w*)\s*\(")
_MOVES = pattern(rb"(?i)(?:S?LIN|S?PTP|S?CIRC)(?:_REL)?\b|SPLINE\b|SPL\b|ASYPTP\b")
_SETS = pattern(
    rb"(?i)\$(?:BASE|TOOL|IPO_MODE)\b[^=]*=(?!=)|BAS\s*\(\s*#(?:PTP_PARAMS|CP_PARAMS|FRAMES|BASE|TOOL|INITMOV|EX_BASE)\b"
)
#: The first word of a statement of a block, and what it does.
BLOCK = pattern(
    rb"(?i)(?:(?P<routine>(?:GLOBAL\s+)?DEF(?:FCT)?)\b|(?P<data>(?:GLOBAL\s+)?DEFDAT|ENDDAT)\b|"
    rb"(?P<last>END|ENDFCT)(?![\w\[.=(])|(?P<if>IF|SWITCH)\b|"
    rb"(?P<loop>FOR|WHILE|REPEAT|LOOP)\b|(?P<else>ELSE|CASE|DEFAULT)\b|"
    rb"(?P<end>ENDIF|ENDSWITCH|ENDFOR|ENDWHILE|UNTIL|ENDLOOP)\b|(?P<label>[A-Z]\w*\s*:\s*$))"
)
_ARGUMENT = pattern(rb"[(,]\s*([A-Za-z]\w*)\s*(?:\[[^\]]*\]\s*)?(?=[,)])")
_STRING = pattern(rb'"[^"]*"')


@dataclass(slots=True)
class _Routine:
    moves: bool
    sets: bool
    calls: set[bytes]


def routine_of(text: bytes) -> bytes:
    """The name of a routine that a line begins, in capitals."""
    match = _ROUTINE.match(text)
    return b"" if match is None else match[1].upper()


def is_move(text: bytes) -> bool:
    return _MOVES.match(text) is not None


def sets_frames(text: bytes) -> bool:
    """Whether a statement sets base or tool, or whether the tool stands still."""
    return _SETS.match(text) is not None


def calls_in(text: bytes) -> list[bytes]:
    """The routines that a statement calls, in capitals, but for those that do nothing to the path."""
    if b"(" not in text:
        return []
    names = (name.upper() for name in _CALL.findall(_STRING.sub(b"", text)))
    return [name for name in names if name not in STILL]


def arguments_in(text: bytes) -> list[bytes]:
    """The names that stand alone as arguments of calls."""
    return _ARGUMENT.findall(_STRING.sub(b"", text))


class Flow:
    """What the routines of a text do. A routine of another text may do anything."""

    def __init__(self, lines: Sequence[Line]) -> None:
        self._routines: dict[bytes, _Routine] = {}
        current: _Routine | None = None
        for line in lines:
            text = line.text
            name = routine_of(text)
            if name:
                current = self._routines[name] = _Routine(moves=False, sets=False, calls=set())
            elif current is not None:
                current.moves |= is_move(text)
                current.sets |= sets_frames(text)
                current.calls.update(calls_in(text))
        self._spread()
        #: whether any statement sets base or tool
        self.sets = any(sets_frames(line.text) for line in lines)
        self._loops = self._setting_loops(lines)

    def _spread(self) -> None:
        """What a routine calls, it does too."""
        changed = True
        while changed:
            changed = False
            for routine in self._routines.values():
                moves = routine.moves or any(self.moves(name) for name in routine.calls)
                sets = routine.sets or any(self.may_set(name) for name in routine.calls)
                changed |= (moves, sets) != (routine.moves, routine.sets)
                routine.moves, routine.sets = moves, sets

    def known(self, name: bytes) -> bool:
        return name in self._routines

    def moves(self, name: bytes) -> bool:
        """Whether a routine may move the robot."""
        routine = self._routines.get(name)
        return routine is None or routine.moves

    def may_set(self, name: bytes) -> bool:
        """Whether a routine may set base or tool."""
        routine = self._routines.get(name)
        return routine is None or routine.sets

    def sets_in_loop(self, line: int) -> bool:
        """Whether base or tool may be set in the loop that begins in a line."""
        return line in self._loops

    def _setting_loops(self, lines: Sequence[Line]) -> set[int]:
        found: set[int] = set()
        open_: list[tuple[int, bool]] = []
        for line in lines:
            match = BLOCK.match(line.text)
            kind = None if match is None else match.lastgroup
            if kind in ("if", "loop"):
                open_.append((line.line, kind == "loop"))
            elif kind == "end" and open_:
                open_.pop()
            elif open_ and (
                sets_frames(line.text) or any(self.may_set(name) for name in calls_in(line.text))
            ):
                found.update(begin for begin, loop in open_ if loop)
        return found
