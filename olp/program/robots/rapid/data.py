"""The data that a RAPID text declares, by the routine that they belong to."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import NamedTuple

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.projects import FileLines
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
    rb"(?is)(?:(?:LOCAL|TASK)\s+)?(CONST|PERS|VAR)\s+(\w+)\s+(\w+)\s*(\{[^}]*\})?\s*(?::=\s*(.*\S|))?\s*"
)
#: The first words of declarations.
_DECLARING = frozenset((b"LOCAL", b"TASK", b"CONST", b"PERS", b"VAR"))
_SPEED = pattern(rb"\[\s*" + NUMBER + rb"\s*,.*\]\s*")
_NAME = pattern(rb"[A-Za-z]\w*")
#: Data that are given to others in turn.
_DEEPEST = 8
_FIRST_SPEED = pattern(rb"(?i)v(\d+)")


class Scope(NamedTuple):
    """A routine of a module by its name in capitals, "" for the module itself; modules by their order."""

    module: int
    routine: str

    def next_module(self) -> Scope:
        return Scope(self.module + 1, "")

    def of(self, routine: str) -> Scope:
        """A routine of the same module."""
        return Scope(self.module, routine)


#: Before the first module.
NO_MODULE = Scope(0, "")
#: What all modules see.
_GLOBAL = Scope(-1, "")


@dataclass(frozen=True, slots=True)
class Data:
    """Declared data: where, its kind and its type in capitals, and the bytes of its value, None without.
    Other modules do not see one that is `local`, nor one of a routine."""

    statement: Statement
    scope: Scope
    local: bool
    kind: bytes
    type: bytes
    array: bool
    value: Span | None


@dataclass(frozen=True, slots=True)
class Given:
    """A statement that gives data another value, its routine, and the bytes of that value, None where it
    does not give them a whole one."""

    statement: Statement
    scope: Scope
    value: Span | None


class Declared:
    """All data of a text by scope and name in capitals, and `parameters`: the names by routine that callers
    give values to."""

    def __init__(self, data: bytes, moves: RobotMoves) -> None:
        self.data, self.moves, self._files = data, moves, FileLines(data)
        self._data: dict[tuple[Scope, str], list[Data]] = {}
        #: by name: where it may get another value
        self._given: dict[str, list[Given]] = {}
        self.parameters: dict[Scope, list[str]] = {}
        self._targets: dict[tuple[int, int], int] = {}
        self._speeds: dict[tuple[bytes, Scope], float] = {}

    def declare(self, statement: Statement, scope: Scope) -> bool:
        """Whether a statement declares data, which are kept."""
        match = _DECLARED.fullmatch(statement.text) if statement.word in _DECLARING else None
        if match is None:
            return False
        start = statement.begin
        value = None if match[5] is None else (start + match.start(5), start + match.end(5))
        name = match[3].decode("latin-1").upper()
        local = bool(scope.routine) or match[0][:5].upper() == b"LOCAL"
        found = Data(
            statement, scope, local, match[1].upper(), match[2].upper(), match[4] is not None, value
        )  # fmt: skip
        self._data.setdefault((scope, name), []).append(found)
        if not local:
            self._data.setdefault((_GLOBAL, name), []).append(found)
        return True

    def give(self, name: str, given: Given) -> None:
        """A name, in capitals, may get another value."""
        self._given.setdefault(name, []).append(given)

    def _seen(self, name: str, scope: Scope) -> list[Data]:
        """The data that a name means in a routine; empty where the text declares none."""
        for place in (scope, scope.of(""), _GLOBAL):
            data = self._data.get((place, name))
            if data is not None:
                return data
        return []

    def _changed(self, name: str, data: Data) -> Given | None:
        """Where data first get another value, None where nothing gives them one."""
        for given in self._given.get(name, ()):
            module = given.scope.module
            own = module == data.scope.module
            if own or (not data.local and (Scope(module, ""), name) not in self._data):
                return given
        return None

    def _line(self, line: int) -> str:
        """A line in words, with its file where the text holds several."""
        file, own = self._files.of(line)
        return f"line {own} of {file}" if file else f"line {own}"

    def _place(self, data: Data) -> str:
        return self._line(data.statement.line)

    def find(self, name: str, kind: bytes, routine: Scope, line: int, depth: int = 0) -> Data | None:
        """The data of a name and a type, None where the text declares none. Raises ProgramError where a move
        cannot rely on its value."""
        key = name.upper()
        if key in self.parameters.get(routine, ()):
            raise DecidedInRun(f"the caller gives {name}", line=line, code="OLP533")
        data = self._seen(key, routine)
        if not data:
            return None
        values = {None if d.value is None else self.data[slice(*d.value)] for d in data}
        if len(values) > 1 or len({d.scope for d in data}) > 1:
            raise ProgramError(
                f"{name} is declared twice, in {self._place(data[0])} and {self._place(data[1])}; "
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
        changed = self._changed(key, data[0])
        if changed is None:
            return data[0]
        value = b"" if changed.value is None else self.data[slice(*changed.value)]
        if self._only(key, data[0], changed):
            if value[:1] == b"[":
                return replace(data[0], statement=changed.statement, value=changed.value)
            # another datum, which may be one of these in turn
            if _NAME.fullmatch(value) and depth < _DEEPEST:
                other = self.find(value.decode(), kind, changed.scope, line, depth + 1)
                if other is not None and self._names(other, routine):
                    return other
        raise DecidedInRun(
            f"{name} gets another value in {self._line(changed.statement.line)}, so its value here depends "
            "on the run; state it once, with its numbers",
            line=line,
            code="OLP533",
        )

    @staticmethod
    def _names(data: Data, scope: Scope) -> bool:
        """Whether a move of a routine could name data, or a clone beside them."""
        return not data.local or data.scope in (scope, scope.of(""))

    def _only(self, name: str, data: Data, given: Given) -> bool:
        """Whether what a statement gives to data that are declared without a value is the only value that
        they ever have: before it a move to them, or with them, stops the control."""
        alone = len(self._given[name]) == 1 and given.value is not None and data.value is None
        return alone and not data.array and any(seen is data for seen in self._seen(name, given.scope))

    def target(self, name: str, index: int, routine: Scope, line: int) -> int:
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
                f"the target {name} is not stated with its numbers in {self._place(data)}",
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
                stated.outer, along=stated.along,
            )  # fmt: skip
        return known

    def _element(self, data: Data, form: re.Pattern[bytes], index: int) -> re.Match[bytes] | None:
        """The element `index` of an array, or data that are none where it is 0; None where the text does not
        state it with numbers."""
        assert data.value is not None
        if not data.array:
            return form.fullmatch(self.data, *data.value) if index == 0 else None
        matches = list(form.finditer(self.data, *data.value))
        return matches[index - 1] if 0 < index <= len(matches) else None

    def joints(self, name: str, index: int, routine: Scope, line: int) -> int | None:
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

    def tool(self, name: str, routine: Scope, line: int) -> Pose | None:
        """The frame of a declared tool."""
        if name.lower() == "tool0":
            return Pose()
        data = self.find(name, b"TOOLDATA", routine, line)
        if data is None or data.value is None:
            return None
        return tool_of(self.data[slice(*data.value)], name, data.statement.line)

    def frame(self, name: str, routine: Scope, line: int) -> Pose | None:
        """The pose of a declared work object."""
        data = self.find(name, b"WOBJDATA", routine, line)
        if data is None or data.value is None:
            return None
        return frame_of(self.data[slice(*data.value)], name, data.statement.line)

    def speed(self, text: bytes, routine: Scope) -> float:
        """A speed in mm/s, NaN where the text does not state it."""
        key = text, routine
        if key not in self._speeds:
            self._speeds[key] = self._speed(text, routine)
        return self._speeds[key]

    def _speed(self, text: bytes, routine: Scope) -> float:
        match = _SPEED.fullmatch(text)
        if match is None:
            name = text.decode("latin-1")
            data = self._seen(name.upper(), routine)
            if data and data[0].value is not None and self._changed(name.upper(), data[0]) is None:
                match = _SPEED.fullmatch(self.data[slice(*data[0].value)])
        first = _FIRST_SPEED.fullmatch(text)
        if match is None:
            return float(first[1]) if first else float("nan")
        return float(match[1])
