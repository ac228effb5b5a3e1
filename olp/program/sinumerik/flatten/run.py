"""Runs a parametric program in the order of its execution: loops, jumps, subprograms and their parameters.

Source: Siemens, Programming Manual Job Planning, sections on jumps, control structures and subprograms.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from olp.core.budget import Budget
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.sinumerik.blocks import Form, Piece, arguments
from olp.program.sinumerik.flatten.expressions import Value, evaluate, number
from olp.program.sinumerik.flatten.scope import Scope
from olp.program.sinumerik.flatten.unit import Line, Unit
from olp.program.sinumerik.refusals import return_elsewhere
from olp.program.sinumerik.table import DRILLING, HARMLESS, PATTERNS, READ, REFUSED

#: Subprograms inside one another at most.
_DEEPEST = 16
_JUMP = re.compile(r"(.*?)\b(GOTO[FB]?)[ \t]+([A-Z_][A-Z0-9_]*|\d+)[ \t]*$", re.IGNORECASE)
_RANGE = re.compile(r"([A-Z_][A-Z0-9_\[\]]*)[ \t]*=(.*?)\bTO\b(.*)$", re.IGNORECASE)
_ARMS = re.compile(r"(.*?)[ \t]+(GOTO[FB]?)[ \t]+([A-Z_][A-Z0-9_]*)[ \t]*", re.IGNORECASE)
_NAMES = re.compile(r"[A-Z_][A-Z0-9_]*")
_CASE = re.compile(r"(.*?)\bOF\b(.*)$", re.IGNORECASE)
_KNOWN = frozenset({*DRILLING, *HARMLESS, *READ, *REFUSED, *PATTERNS, "CYCLE80", "CIP", "CT"})
_REPEATED = re.compile(
    r"[ \t]*([A-Z_][A-Z0-9_]*)(?:[ \t]+(?!P[ \t]*=)([A-Z_][A-Z0-9_]*))?[ \t]*(?:P[ \t]*=?(.*))?$",
    re.IGNORECASE,
)


@dataclass(slots=True, eq=False)
class _Loop:
    """A loop that runs: its line, that of its end, and the variable and the last value of FOR."""

    begin: int
    end: int
    variable: str = ""
    last: float = 0.0


class Stop(Exception):
    """The program has ended."""


class Walk:
    """Runs a program. `visit` writes a line; it is given the unit, the line and the variables in force.
    `kept` is around a subprogram with SAVE, with the unit and the line that call it."""

    def __init__(
        self,
        visit: Callable[[Unit, Line, Scope], bool],
        kept: Callable[[Unit, Line], AbstractContextManager[None]],
        find: Callable[[str], Unit | None],
        budget: Budget,
        *,
        block_delete: bool | None,
    ) -> None:
        self._visit, self._kept, self._find = visit, kept, find
        self._budget, self._block_delete = budget, block_delete
        #: the program itself, not a subprogram
        self._main: Unit | None = None

    def run(self, unit: Unit, scope: Scope, depth: int = 0) -> None:
        """Run a text to its end, RET or M17. Raises `Stop` at M2 and M30, ProgramError with line and file."""
        loops: list[_Loop] = []
        index = 0
        if not depth:
            self._main = unit
        while 0 <= index < len(unit.texts):
            try:
                line = unit.line(index)
                self._budget.spend(len(line.raw) + 16)
                index = self._step(unit, line, index, scope, loops, depth)
            except ProgramError as error:
                if error.line is None:
                    error.line, error.file = unit.first + index + 1, unit.file
                raise
            if index < 0:
                return

    def _step(self, unit: Unit, line: Line, index: int, scope: Scope, loops: list[_Loop], depth: int) -> int:
        """Carry out one line; returns the next one, -1 at the end of the text."""
        if line.deleted and self._block_delete:
            return index + 1
        called = None
        if not line.keyword and line.block is not None and line.block.pieces:
            called = self._called(line, line.block.pieces[0])
        if (line.deleted and self._block_delete is None) and (
            line.keyword or called is not None or self._assigns(line, scope)
        ):
            raise ProgramError(
                "a block under block delete controls the run, so both positions of the switch give other "
                "programs; state block_delete in the job file, or remove the `/`",
                code="OLP525",
            )
        if line.keyword:
            return self._control(unit, line, index, scope, loops, depth)
        if line.block is None or not line.block.pieces:
            self._visit(unit, line, scope)
            return index + 1
        if called is not None:
            self._call(*called, (unit, line), scope, depth)
            return index + 1
        if any(piece.name == "RET" for piece in line.block.pieces):
            raise return_elsewhere(line.code)
        if depth and self._returns(line):
            if len(line.block.pieces) > 1:
                raise ProgramError(
                    "M17 of a subprogram stands beside other words; put it into a block of its own",
                    code="OLP542",
                )
            return -1
        if self._visit(unit, line, scope):
            if unit is not self._main:
                raise ProgramError(
                    "M2 or M30 of a subprogram: whether the control goes on behind the call is not known; "
                    "write RET or M17",
                    code="OLP542",
                )
            raise Stop
        return -1 if self._returns(line) else index + 1

    # -- control -----------------------------------------------------------------------------------

    def _control(
        self, unit: Unit, line: Line, index: int, scope: Scope, loops: list[_Loop], depth: int
    ) -> int:
        word, rest = line.keyword, line.rest
        if word == "DEF":
            scope.define(rest)
        elif word == "PROC":
            pass
        elif word == "RET":
            if rest.strip().strip("()").strip():
                raise return_elsewhere(f"RET{rest}")
            if not depth:
                self._visit(unit, line, scope)
            return -1
        elif word in ("GOTO", "GOTOF", "GOTOB"):
            return self._jump(unit, index, word, rest.strip(), loops)
        elif word == "IF":
            return self._if(unit, index, rest, scope, loops)
        elif word == "CASE":
            return self._case(unit, index, rest, scope, loops)
        elif word == "ELSE":
            return next(e[-1] for e in unit.closing.values() if index in e) + 1
        elif word == "REPEATB" or (word == "REPEAT" and rest.strip()):
            self._part(unit, index, word, rest, scope, depth)
        elif word in ("FOR", "WHILE", "LOOP", "REPEAT"):
            return self._begin(unit, index, word, rest, scope, loops)
        elif word in ("ENDFOR", "ENDWHILE", "ENDLOOP", "UNTIL"):
            return self._end(unit, index, word, rest, scope, loops)
        elif word in ("CALL", "EXTCALL"):
            name = evaluate(rest, scope)
            if not isinstance(name, str):
                raise ProgramError(f"{word} needs the name of a subprogram as text", code="OLP540")
            self._call(_file_name(name), [], "1", (unit, line), scope, depth)
        elif word != "ENDIF":
            raise ProgramError(f"{word} is not run; write GOTOF or GOTOB", code="OLP542")
        return index + 1

    def _part(self, unit: Unit, index: int, word: str, rest: str, scope: Scope, depth: int) -> None:
        """REPEAT and REPEATB: a part of the program, or one block of it, again."""
        stated = _REPEATED.match(rest)
        if stated is None or (word == "REPEATB" and stated[2]):
            raise ProgramError(f"{word} needs a label, and P= for the number of its runs", code="OLP542")
        runs = _runs(word, number(stated[3], scope) if stated[3] else 1.0)
        begin = self._labelled(unit, stated[1])
        if word == "REPEATB":
            stop = begin
        elif stated[2]:
            stop = self._labelled(unit, stated[2])
        else:
            ends = [k for k in unit.labels.get("ENDLABEL", []) if k > begin and not begin < index < k]
            stop = ends[0] if ends else index - 1
        if stop < begin or begin <= index <= stop or depth >= _DEEPEST:
            raise ProgramError(f"{word} does not end before its own block; write the part out", code="OLP542")
        for _ in range(runs):
            self._section(unit, begin, stop, scope, depth)

    def _section(self, unit: Unit, begin: int, stop: int, scope: Scope, depth: int) -> None:
        """The lines of a part, once, with the lines of their own in a message."""
        loops: list[_Loop] = []
        index = begin
        while index <= stop:
            line = unit.line(index)
            self._budget.spend(len(line.raw) + 16)
            try:
                index = self._step(unit, line, index, scope, loops, depth + 1)
            except ProgramError as error:
                if error.line is None:
                    error.line, error.file = unit.first + index + 1, unit.file
                raise
            if not begin <= index <= stop + 1:
                raise ProgramError("a jump leaves the part of REPEAT; write the part out", code="OLP542")

    @staticmethod
    def _labelled(unit: Unit, label: str) -> int:
        places = unit.labels.get(label.upper(), [])
        if len(places) != 1:
            raise ProgramError(f"the label {label} of REPEAT is there {len(places)} times", code="OLP542")
        return places[0]

    def _if(self, unit: Unit, index: int, rest: str, scope: Scope, loops: list[_Loop]) -> int:
        jump = _JUMP.match(rest)
        if jump is not None:
            if self._true(jump[1], scope):
                return self._jump(unit, index, jump[2].upper(), jump[3], loops)
            return index + 1
        if index not in unit.closing:
            raise ProgramError("IF without GOTOF, GOTOB or ENDIF", code="OLP542")
        if self._true(rest, scope):
            return index + 1
        return unit.closing[index][0] + 1

    def _case(self, unit: Unit, index: int, rest: str, scope: Scope, loops: list[_Loop]) -> int:
        parts = _CASE.match(rest)
        if parts is None:
            raise ProgramError("CASE needs OF behind its expression", code="OLP542")
        value = evaluate(parts[1], scope)
        for constant, jump, label in _ARMS.findall(parts[2]):
            name = constant.strip().upper()
            if name == "DEFAULT" or evaluate(f"{_text(value)} == ({constant})", scope):
                return self._jump(unit, index, jump.upper(), label, loops)
        return index + 1

    @staticmethod
    def _true(text: str, scope: Scope) -> bool:
        value = evaluate(text, scope)
        if isinstance(value, str):
            raise ProgramError(f"`{text.strip()}` is no condition", code="OLP540")
        return bool(value)

    @staticmethod
    def _jump(unit: Unit, index: int, word: str, label: str, loops: list[_Loop]) -> int:
        places = unit.labels.get(label.upper(), [])
        ahead, behind = [p for p in places if p > index], [p for p in places if p <= index]
        target = {"GOTOF": ahead[:1], "GOTOB": behind[-1:]}.get(word, ahead[:1] or behind[-1:])
        if not target:
            raise ProgramError(f"the label {label} of {word} is not in its direction", code="OLP542")
        while loops and not loops[-1].begin < target[0] < loops[-1].end:
            loops.pop()
        return target[0]

    def _begin(self, unit: Unit, index: int, word: str, rest: str, scope: Scope, loops: list[_Loop]) -> int:
        loop = _Loop(index, unit.closing[index][-1])
        if word == "WHILE" and not self._true(rest, scope):
            return loop.end + 1
        if word == "FOR":
            span = _RANGE.match(rest)
            if span is None:
                raise ProgramError(
                    "FOR needs a variable, its first value, TO and its last value", code="OLP542"
                )
            loop.variable = span[1].upper()
            scope[loop.variable] = number(span[2], scope)
            loop.last = number(span[3], scope)
            if number(loop.variable, scope) > loop.last:
                return loop.end + 1
        loops.append(loop)
        return index + 1

    def _end(self, unit: Unit, index: int, word: str, rest: str, scope: Scope, loops: list[_Loop]) -> int:
        if not loops or loops[-1].end != index:
            raise ProgramError(f"{word} is reached by a jump, not through its loop", code="OLP542")
        loop = loops[-1]
        if word == "ENDFOR":
            scope[loop.variable] = number(loop.variable, scope) + 1.0
            again = number(loop.variable, scope) <= loop.last
        elif word == "UNTIL":
            again = not self._true(rest, scope)
        elif word == "ENDWHILE":
            again = self._true(unit.line(loop.begin).rest, scope)
        else:
            again = True
        if again:
            return loop.begin + 1
        loops.pop()
        return index + 1

    # -- subprograms -------------------------------------------------------------------------------

    def _called(self, line: Line, first: Piece) -> tuple[str, list[str], str] | None:
        """Name, arguments and number of runs of a subprogram that a line calls, the number as written; None
        where it calls none."""
        assert line.block is not None
        others = line.block.pieces[1:]
        code = line.code
        runs = "1"
        if first.form is Form.WORD and first.name == "P" and others:
            runs, first, others = code[first.value : first.value_end], others[0], others[1:]
        if others and others[-1].name == "P" and others[-1].form in (Form.WORD, Form.EQUAL):
            runs = code[others[-1].value : others[-1].value_end]
            others = others[:-1]
        if first.form is Form.WORD and first.name == "L":
            name = code[first.start : first.end].upper().replace(" ", "")
            return None if others else (name, [], runs)
        if first.form is not Form.NAME or others or first.name in _KNOWN:
            return None
        given = [a.decode("latin-1") for a in arguments(line.raw, first)]
        return first.name, given, runs

    def _call(
        self, name: str, given: list[str], runs: str, place: tuple[Unit, Line], scope: Scope, depth: int
    ) -> None:
        unit = self._find(name)
        if unit is None:
            raise ProgramError(
                f"the subprogram {name} is not in this file nor beside it; put {name}.SPF into the folder "
                "of the program",
                code="OLP542",
            )
        if depth >= _DEEPEST:
            raise ProgramError(f"subprograms call one another more than {_DEEPEST} deep", code="OLP542")
        head = _head(unit)
        parameters = head.partition("(")[2].rpartition(")")[0]
        saves = "SAVE" in _NAMES.findall(head.upper())[1:]
        for _ in range(_runs(name, number(runs, scope))):
            own = scope.inner()
            own.bind(parameters, given, scope)
            with self._kept(*place) if saves else nullcontext():
                self.run(unit, own, depth + 1)

    def _assigns(self, line: Line, scope: Scope) -> bool:
        pieces = line.block.pieces if line.block is not None else ()
        return any(piece.form is Form.EQUAL and scope.is_variable(piece.name) for piece in pieces)

    @staticmethod
    def _returns(line: Line) -> bool:
        pieces = line.block.pieces if line.block is not None else ()
        return any(p.name == "M" and line.code[p.value : p.value_end].strip() == "17" for p in pieces)


def _runs(name: str, value: float) -> int:
    """How often something runs. Raises ProgramError for what is no count."""
    if value != round(value) or value < 0:
        raise ProgramError(f"{name} runs {value:g} times; expected an integer", code="OLP542")
    return round(value)


def _text(value: Value) -> str:
    return (
        f'"{value}"' if isinstance(value, str) else f"({float(value)!r})" if value >= 0 else f"(-{-value!r})"
    )


def _file_name(text: str) -> str:
    """The name of a subprogram in a text, which may have a folder and an ending."""
    name = text.strip().replace("\\", "/").upper().rpartition("/")[2].removeprefix("_N_")
    return re.sub(r"[._]([SM]PF)\Z", "", name)


def _head(unit: Unit) -> str:
    """What stands behind PROC in a subprogram: its name, parameters and attributes; empty without PROC."""
    for index in range(len(unit.texts)):
        line = unit.line(index)
        if line.keyword == "PROC":
            return line.rest
        if line.block is not None and line.block.pieces:
            break
    return ""
