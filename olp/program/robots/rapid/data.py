"""The data that a RAPID text declares, by the routine that they belong to."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.moves import DecidedInRun, RobotMoves
from olp.program.robots.poses import Pose
from olp.program.robots.rapid.text import Statement
from olp.program.robots.rapid.values import (
    JOINTTARGET,
    NUMBER,
    ROBTARGET,
    frame_of,
    joints_of,
    target_of,
    tool_of,
)
from olp.program.robots.targets import Span

_DECLARED = pattern(
    rb"(?is)(?:(?:LOCAL|TASK)\s+)?(CONST|PERS|VAR)\s+(\w+)\s+(\w+)\s*(\{[^}]*\})?\s*(?::=\s*(.*?))?\s*"
)
_SPEED = pattern(rb"\[\s*" + NUMBER + rb"\s*,.*\]\s*")
_FIRST_SPEED = pattern(rb"(?i)v(\d+)")


@dataclass(frozen=True, slots=True)
class Data:
    """Declared data: where, its kind and its type in capitals, and the bytes of its value, None without."""

    statement: Statement
    kind: bytes
    type: bytes
    array: bool
    value: Span | None


class Declared:
    """All data of a text by routine ("" for those of modules) and name in capitals. `assigned` are the lines
    where a name gets another value, and `parameters` the names by routine that callers give values to."""

    def __init__(self, data: bytes, moves: RobotMoves) -> None:
        self.data, self.moves = data, moves
        self._data: dict[tuple[str, str], list[Data]] = {}
        self.assigned: dict[str, int] = {}
        self.parameters: dict[str, list[str]] = {}
        self._targets: dict[tuple[int, int], int] = {}

    def declare(self, statement: Statement, routine: str) -> bool:
        """Whether a statement declares data, which are kept."""
        match = _DECLARED.fullmatch(statement.text)
        if match is None:
            return False
        start = statement.begin
        value = None if match[5] is None else (start + match.start(5), start + match.end(5))
        name = match[3].decode("latin-1").upper()
        found = Data(statement, match[1].upper(), match[2].upper(), match[4] is not None, value)
        self._data.setdefault((routine, name), []).append(found)
        return True

    def find(self, name: str, kind: bytes, routine: str, line: int) -> Data | None:
        """The data of a name and a type, None where the text declares none. Raises ProgramError where a move
        cannot rely on its value."""
        key = name.upper()
        if key in self.parameters.get(routine, ()):
            raise DecidedInRun(f"the caller gives {name}", line=line, code="OLP533")
        data = self._data.get((routine, key)) or self._data.get(("", key))
        if data is None:
            return None
        if len({None if d.value is None else self.data[slice(*d.value)] for d in data}) > 1:
            raise ProgramError(
                f"{name} is declared twice, in lines {data[0].statement.line} and {data[1].statement.line}; "
                "give each its own name",
                line=line,
                code="OLP533",
            )
        if data[0].type != kind:
            raise ProgramError(
                f"{name} is of the type {data[0].type.decode().lower()}; expected {kind.decode().lower()}",
                line=line,
                code="OLP533",
            )
        if key in self.assigned:
            raise DecidedInRun(
                f"{name} gets another value in line {self.assigned[key]}, so its value here depends on the "
                "run; state it once, with its numbers",
                line=line,
                code="OLP533",
            )
        return data[0]

    def target(self, name: str, index: int, routine: str, line: int) -> int:
        """The place of a declared target. Raises ProgramError where the text does not state it."""
        data = self.find(name, b"ROBTARGET", routine, line)
        if data is None or data.value is None:
            raise DecidedInRun(
                f"the target {name} is not stated in this text; declare it here with its numbers, or correct "
                "the module that declares it",
                line=line,
                code="OLP533",
            )
        if data.kind == b"PERS":
            what = f"{name} is PERS: its value in this text is taken as current"
            self.moves.remark("pers", data.statement.line, what)
        match = self._element(data, ROBTARGET, index)
        if match is None:
            raise DecidedInRun(
                f"the target {name} is not stated with its numbers in line {data.statement.line}",
                line=line,
                code="OLP533",
            )
        key = match.span()
        known = self._targets.get(key)
        if known is None:
            stated = target_of(match, data.statement.line)
            known = self._targets[key] = self.moves.target(
                data.statement.line, key, stated.spans, stated.point, stated.turn, stated.rest, name,
                (data.statement.begin, data.statement.end), stated.turned, stated.turns, stated.config,
                stated.outer,
            )  # fmt: skip
        return known

    def _element(self, data: Data, form: re.Pattern[bytes], index: int) -> re.Match[bytes] | None:
        """The element `index` of an array, or data that are none where it is 0; None where the text does not
        state it with numbers."""
        assert data.value is not None
        matches = list(form.finditer(self.data, *data.value))
        if data.array:
            return matches[index - 1] if 0 < index <= len(matches) else None
        whole = len(matches) == 1 and index == 0 and matches[0].span() == data.value
        return matches[0] if whole else None

    def joints(self, name: str, index: int, routine: str, line: int) -> int | None:
        """The place of declared joint values; None where this text does not state them, or they change."""
        try:
            data = self.find(name, b"JOINTTARGET", routine, line)
        except ProgramError:
            return None
        match = None if data is None or data.value is None else self._element(data, JOINTTARGET, index)
        if data is None or match is None:
            return None
        key = match.span()
        if key not in self._targets:
            stated = joints_of(match)
            self._targets[key] = self.moves.joint_target(
                data.statement.line, key, stated.spans, stated.degrees, stated.outer, name,
                (data.statement.begin, data.statement.end),
            )  # fmt: skip
        return self._targets[key]

    def tool(self, name: str, routine: str, line: int) -> Pose | None:
        """The frame of a declared tool."""
        if name.lower() == "tool0":
            return Pose()
        data = self.find(name, b"TOOLDATA", routine, line)
        if data is None or data.value is None:
            return None
        return tool_of(self.data[slice(*data.value)], name, data.statement.line)

    def frame(self, name: str, routine: str, line: int) -> Pose | None:
        """The pose of a declared work object."""
        data = self.find(name, b"WOBJDATA", routine, line)
        if data is None or data.value is None:
            return None
        return frame_of(self.data[slice(*data.value)], name, data.statement.line)

    def speed(self, text: bytes, routine: str, line: int) -> float:
        """A speed in mm/s, NaN where the text does not state it."""
        match = _SPEED.fullmatch(text)
        if match is None:
            name = text.decode("latin-1")
            data = self._data.get((routine, name.upper())) or self._data.get(("", name.upper()))
            if data is not None and data[0].value is not None and name.upper() not in self.assigned:
                match = _SPEED.fullmatch(self.data[slice(*data[0].value)])
        first = _FIRST_SPEED.fullmatch(text)
        if match is None:
            return float(first[1]) if first else float("nan")
        return float(match[1])
