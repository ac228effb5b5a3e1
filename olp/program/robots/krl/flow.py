"""Which statements of a KRL text may move the robot or set base and tool, and what a block may do."""

from __future__ import annotations

import re
from collections.abc import Sequence

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.krl.table import STILL, WRITING
from olp.program.robots.krl.text import Line

_ROUTINE = pattern(rb"(?i)(?:GLOBAL\s+)?DEF(?:FCT\s+\w+(?:\s*\[[^\]]*\])?)?\s+(\w+)\s*\(")
_CALL = pattern(rb"(?i)(?<![#$.\w])([A-Z]\w*)\s*\(")
#: The first words of moves to positions, and of all moves.
PATHS = frozenset((b"LIN", b"PTP", b"CIRC", b"SLIN", b"SPTP", b"SCIRC"))
_MOVES = PATHS | {word + b"_REL" for word in PATHS} | {b"SPLINE", b"SPL", b"ASYPTP"}
_SETS = pattern(
    rb"(?i)\$(?:BASE|TOOL|IPO_MODE)\b[^=]*=(?!=)|BAS\s*\(\s*#(?:PTP_PARAMS|CP_PARAMS|FRAMES|BASE|TOOL|INITMOV|EX_BASE)\b"
)
#: The first word of a statement of a block, and what it does.
_BLOCK = pattern(
    rb"(?i)(?:(?P<routine>(?:GLOBAL\s+)?DEF(?:FCT)?)\b|(?P<data>(?:GLOBAL\s+)?DEFDAT|ENDDAT)\b|"
    rb"(?P<last>END|ENDFCT)(?![\w\[.=(])|(?P<if>IF|SWITCH)\b|"
    rb"(?P<loop>FOR|WHILE|REPEAT|LOOP)\b|(?P<else>ELSE|CASE|DEFAULT)\b|"
    rb"(?P<end>ENDIF|ENDSWITCH|ENDFOR|ENDWHILE|UNTIL|ENDLOOP)\b|(?P<label>[A-Z]\w*\s*:\s*$))"
)
_ROUTINES = frozenset((b"GLOBAL", b"DEF", b"DEFFCT"))
_BLOCKS = _ROUTINES | frozenset(
    (b"DEFDAT", b"ENDDAT", b"END", b"ENDFCT", b"IF", b"SWITCH", b"FOR", b"WHILE", b"REPEAT", b"LOOP", b"ELSE",
     b"CASE", b"DEFAULT", b"ENDIF", b"ENDSWITCH", b"ENDFOR", b"ENDWHILE", b"UNTIL", b"ENDLOOP")
)  # fmt: skip
#: A name, an element, or a component of one.
_ARGUMENT = pattern(rb"[(,]\s*([A-Za-z]\w*)\s*(?:\[[^\]]*\]\s*)?(?:\.\s*\w+\s*(?:\[[^\]]*\]\s*)?)*(?=[,)])")
_PARAMETER = pattern(rb"(?i)\s*(\w+)\s*(?:\[[\s,]*\]\s*)?(?::\s*(IN|OUT)\s*)?")
_STRING = pattern(rb'"[^"]*"')


@dataclass(slots=True)
class _Routine:
    moves: bool
    sets: bool
    calls: set[bytes]
    by_value: bool


def routine_of(line: Line) -> bytes:
    """The name of a routine that a line begins, in capitals."""
    match = _ROUTINE.match(line.text) if line.word in _ROUTINES else None
    return b"" if match is None else match[1].upper()


def block_of(line: Line) -> re.Match[bytes] | None:
    """What a line says of a block (`_BLOCK`); None where it says nothing."""
    return _BLOCK.match(line.text) if line.word in _BLOCKS or line.text[-1:] == b":" else None


def sets_frames(line: Line) -> bool:
    """Whether a statement sets base or tool, or whether the tool stands still."""
    begins = line.text[:1] == b"$" or line.word == b"BAS"
    return begins and _SETS.match(line.text) is not None


def _called(text: bytes) -> list[bytes]:
    """The names before brackets, in capitals."""
    return [name.upper() for name in _CALL.findall(_STRING.sub(b"", text))] if b"(" in text else []


def calls_in(text: bytes) -> list[bytes]:
    """The routines that a statement calls, in capitals, but for those that do nothing to the path."""
    return [name for name in _called(text) if name not in STILL]


def parameters_of(line: Line) -> list[tuple[bytes, bool]]:
    """The parameters of a routine that a line begins, in capitals, and whether callers give them by value."""
    given = line.text.partition(b"(")[2].rpartition(b")")[0]
    matches = map(_PARAMETER.fullmatch, given.split(b","))
    return [(match[1].upper(), (match[2] or b"").upper() == b"IN") for match in matches if match is not None]


class Flow:
    """What the routines of a text do. A routine of another text may do anything."""

    def __init__(self, lines: Sequence[Line]) -> None:
        self._routines: dict[bytes, _Routine] = {}
        current: _Routine | None = None
        for line in lines:
            name = routine_of(line)
            if name:
                current = self._routines[name] = _Routine(
                    moves=False, sets=False, calls=set(), by_value=all(own for _, own in parameters_of(line))
                )
            elif current is not None:
                current.moves |= line.word in _MOVES
                current.sets |= sets_frames(line)
                current.calls.update(calls_in(line.text))
        self._spread()
        #: whether any statement sets base or tool
        self.sets = any(sets_frames(line) for line in lines)
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

    def changed_in(self, text: bytes) -> list[bytes]:
        """The names of data that a statement gives to routines which may change them."""
        changing = (name for name in _called(text) if name in WRITING or name not in STILL)
        if all(name in self._routines and self._routines[name].by_value for name in changing):
            return []
        return _ARGUMENT.findall(_STRING.sub(b"", text))

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
            match = block_of(line)
            kind = None if match is None else match.lastgroup
            if kind in ("if", "loop"):
                open_.append((line.line, kind == "loop"))
            elif kind == "end" and open_:
                open_.pop()
            elif open_ and (sets_frames(line) or any(self.may_set(name) for name in calls_in(line.text))):
                found.update(begin for begin, loop in open_ if loop)
        return found
