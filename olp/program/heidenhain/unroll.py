"""Writes loops, calls and parameters of a Heidenhain program out: the result has numbers in their places.

The program is run here. Each block that is executed is written, with numbers for its parameters. All
assignments, labels, jumps and calls are gone; `plain` then writes out what the control makes of several
blocks. A parameter that the program never sets is refused, except in
words of rotary axes and in feeds, whose bytes stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from olp.core.budget import RUN_BYTES, Budget
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.values import dataclass
from olp.program.dialect import Dialect
from olp.program.heidenhain.cycles import AT_ONCE, PATTERNS
from olp.program.heidenhain.formulas import Parameters, assignment
from olp.program.heidenhain.plain.blocks import number
from olp.program.heidenhain.plain.tools import Radius
from olp.program.heidenhain.plain.writing import written_out
from olp.program.heidenhain.statements import Statement, cycle_of, of_lines
from olp.program.origin import Origin, Unrolled

#: calls inside one another at most
_DEEPEST = 20
_LABEL = re.compile(rb'LBL[ \t]*("[^"]*"|\d+)', re.I)
_CALL = re.compile(rb'CALL[ \t]+LBL[ \t]*("[^"]*"|\d+)[ \t]*(?:REP[ \t]*(\d+)(?:[ \t]*/[ \t]*\d+)?)?\Z', re.I)
_PROGRAM = re.compile(rb'CALL[ \t]+PGM[ \t]+"?([^"]+?)"?[ \t]*\Z', re.I)
_JUMP = re.compile(
    rb"FN[ \t]*(?:9|10|11|12)[ \t]*:[ \t]*IF[ \t]*([-+]?[ \t]*[\w.]+?)[ \t]*(EQU|NE|GT|LT)[ \t]*"
    rb'([-+]?[ \t]*[\w.]+)[ \t]*GOTO[ \t]*LBL[ \t]*("[^"]*"|\d+)\Z', re.I,
)  # fmt: skip
_DEFINED = re.compile(
    rb"FN[ \t]*9[ \t]*:[ \t]*IF[ \t]*\+?(Q[LR]?\d+)[ \t]+IS[ \t]+(UN)?DEFINED[ \t]+"
    rb'GOTO[ \t]*LBL[ \t]*("[^"]*"|\d+)\Z', re.I,
)  # fmt: skip
_COMPARED: Mapping[bytes, Callable[[float, float], bool]] = {
    b"EQU": lambda a, b: a == b, b"NE": lambda a, b: a != b, b"GT": lambda a, b: a > b,
    b"LT": lambda a, b: a < b,
}  # fmt: skip
_UNKNOWN = re.compile(rb"FN[ \t]*18[ \t]*:.*?\b(Q[LR]?\d+)[ \t]*=", re.I | re.S)
#: a parameter in a block, with its sign, where it is no name of a value
_USED = re.compile(rb"((?:[-+][ \t]*)?)(Q[LR]?\d+)(?![\d]|[ \t]*=)", re.I)
_ENDS = re.compile(rb"(?:L\b.*\b)?M0*(?:2|30)\b", re.I | re.S)
#: the parameter that a TOOL CALL sets to the radius of the tool
_RADIUS = "Q108"
_KEPT_BEHIND = frozenset(b"ABCUVWF")


@dataclass(frozen=True, slots=True, eq=False)
class _Unit:
    """A file: its `statements` with the lines of each from `first` to `stop`, and where its labels are."""

    name: str
    lines: tuple[bytes, ...]
    statements: tuple[Statement, ...]
    stop: tuple[int, ...]
    labels: Mapping[bytes, int]

    @staticmethod
    def of(data: bytes, name: str, dialect: Dialect) -> _Unit:
        lines = tuple(dialect.lines(data))
        statements: list[Statement] = []
        stop: list[int] = []
        begin = 0
        labels: dict[bytes, int] = {}
        for k, line in enumerate(lines):
            if dialect.continues(line) and k + 1 < len(lines):
                continue
            statement = of_lines(list(lines[begin : k + 1]), begin + 1)
            match = _LABEL.match(statement.text)
            if match is not None and match[1] != b"0":
                labels.setdefault(match[1].upper(), len(statements))
            statements.append(statement)
            stop.append(k + 1)
            begin = k + 1
        return _Unit(name, lines, tuple(statements), tuple(stop), labels)


def no_subprograms(name: str) -> tuple[str, bytes] | None:
    """The default of `unroll`: there is no other file."""
    return None


def unroll(
    data: bytes,
    dialect: Dialect,
    *,
    subprograms: Callable[[str], tuple[str, bytes] | None] = no_subprograms,
    block_delete: bool | None = False,
    expand_cycles: bool = False,
    peck_clearance: float | None = None,
    parameters: Mapping[str, float] | None = None,
    limit: int = RUN_BYTES,
    setup: Setup | None = None,
    tell: Progress = silent,
) -> Unrolled:
    """Plain blocks of a program, with the origin of each. Blocks with `/` are left as they are. `parameters`
    are values by names such as "Q5", `setup` has the tools of contours. Raises ProgramError with the line in
    the source, and its file."""
    if expand_cycles:
        raise ProgramError(
            "cycles of this dialect are not written out; leave --expand-cycles out", code="OLP544"
        )
    run = _Run(dialect, subprograms, Radius(setup), Budget.of_run(len(data), limit, tell=tell))
    run.parameters.update({name.upper(): value for name, value in (parameters or {}).items()})
    run.stated = dict(run.parameters)
    run.visit(_Unit.of(data, "", dialect), 0, 0, main=True)
    run.write_out(setup)
    return Unrolled.of(b"".join(run.blocks), run.origin())


class _Run:
    """One run: the blocks that were written, and the lines that they were made from."""

    def __init__(
        self, dialect: Dialect, subprograms: Callable[[str], tuple[str, bytes] | None], radius: Radius,
        budget: Budget,
    ) -> None:  # fmt: skip
        self.dialect, self.subprograms, self.radius, self.budget = dialect, subprograms, radius, budget
        self.parameters = Parameters()
        #: those that the job states
        self.stated: Mapping[str, float] = {}
        #: MM or INCH, as the program says
        self.unit_name = b"MM"
        self.blocks: list[bytes] = []
        self.units: list[_Unit] = []
        self._sources: list[tuple[int, int]] = []
        #: the lines of the cycle in force, and their sources
        self._definition: list[tuple[bytes, tuple[int, int]]] = []

    def origin(self) -> Origin:
        counts = np.array([len(unit.lines) for unit in self.units], np.int64)
        first = np.cumsum(counts) - counts
        return Origin(
            tuple(unit.name for unit in self.units[1:]), first[1:],
            tuple(line for unit in self.units for line in unit.lines),
            np.array([int(first[unit]) + line for unit, line in self._sources], np.int64),
        )  # fmt: skip

    def write_out(self, setup: Setup | None) -> None:
        """Write motion that follows from several statements as plain blocks."""
        try:
            self.blocks, self._sources = written_out(self.blocks, self._sources, setup)
        except ProgramError as error:
            if error.line is not None:
                unit, error.line = self._sources[min(error.line, len(self._sources)) - 1]
                error.file = self.units[unit].name or None
            raise

    def visit(self, unit: _Unit, place: int, depth: int, *, main: bool = False, label: bool = False) -> bool:
        """Run the statements of a unit from a place on; a section up to its LBL 0. Returns whether the
        program has ended."""
        if depth > _DEEPEST:
            raise ProgramError(f"calls are nested deeper than {_DEEPEST}", code="OLP543")
        known = next((k for k, other in enumerate(self.units) if other.name == unit.name), -1)
        if known < 0:
            self.units.append(unit)
            known = len(self.units) - 1
        left: dict[int, int] = {}
        while place < len(unit.statements):
            statement = unit.statements[place]
            try:
                after = self._step(unit, known, place, depth, left, main=main, label=label)
            except ProgramError as error:
                if error.line is None:
                    error.line, error.file = statement.line, unit.name or None
                raise
            if after is None:
                return main
            if after < 0:
                return True
            place = after
        return main

    def _step(
        self,
        unit: _Unit,
        known: int,
        place: int,
        depth: int,
        left: dict[int, int],
        *,
        main: bool,
        label: bool,
    ) -> int | None:
        """One statement: where to go on, None at the end of a section or a unit, -1 at the end of all."""
        statement = unit.statements[place]
        upper = statement.upper
        self.budget.spend(len(statement.text) + 8)
        match = _LABEL.match(upper)
        if match is not None:
            return None if label and match[1] == b"0" else place + 1
        if upper.startswith(b"END PGM"):
            if main:
                self._put(unit, known, place)
            return None
        if upper.startswith(b"BEGIN PGM"):
            unit_name = upper.split()[-1]
            if not main:
                if unit_name != self.unit_name:
                    raise ProgramError(
                        "a program is called whose unit is another one, which is not read; write both in MM "
                        "or both in INCH",
                        code="OLP518",
                    )
                return place + 1
            self.unit_name = unit_name
            self.radius.begin(statement)
        jump = _JUMP.match(upper)
        if jump is not None:
            a, b = self.parameters.of(jump[1]), self.parameters.of(jump[3])
            return self._target(unit, jump[4]) if _COMPARED[jump[2]](a, b) else place + 1
        defined = _DEFINED.match(upper)
        if defined is not None:
            # raises where the program has not given it a value, as the control may have one
            self.parameters.of(defined[1])
            return place + 1 if defined[2] else self._target(unit, defined[3])
        call = _CALL.match(upper)
        if call is not None:
            return self._call(unit, call, place, depth, left)
        program = _PROGRAM.match(statement.text)
        if program is not None:
            ended = self._call_program(program[1].decode("latin-1"), depth)
            return -1 if ended else place + 1
        if not statement.deleted and self._assign(statement):
            return place + 1
        self._put(unit, known, place)
        if not statement.deleted and cycle_of(statement) is None and _ENDS.match(upper):
            closing = unit.statements[-1]
            if main and closing.upper.startswith(b"END PGM"):
                self._put(unit, known, len(unit.statements) - 1)
            return -1
        return place + 1

    def _target(self, unit: _Unit, label: bytes) -> int:
        place = unit.labels.get(label.upper())
        if place is None:
            raise ProgramError(f"there is no LBL {label.decode('latin-1')}", code="OLP542")
        return place + 1

    def _call(self, unit: _Unit, call: re.Match[bytes], place: int, depth: int, left: dict[int, int]) -> int:
        target = self._target(unit, call[1])
        if call[2] is not None:
            # REP repeats the section from its label to here
            left[place] = left.get(place, int(call[2])) - 1
            if left[place] >= 0:
                return target
            del left[place]
            return place + 1
        return -1 if self.visit(unit, target, depth + 1, label=True) else place + 1

    def _call_program(self, name: str, depth: int) -> bool:
        wanted = re.split(r"[\\/:]", name)[-1]
        for each in (wanted, wanted.rpartition(".")[0] or wanted):
            for spelled in (each, each.lower(), each.upper()):
                given = self.subprograms(spelled)
                if given is not None:
                    self.visit(_Unit.of(given[1], given[0], self.dialect), 0, depth + 1)
                    return False
        raise ProgramError(f"CALL PGM {name}: there is no such file beside the program", code="OLP542")

    def _assign(self, statement: Statement) -> bool:
        if not re.match(rb"(?:FN|Q[LR]?\d+[ \t]*=)", statement.upper):
            return False
        asked = _UNKNOWN.match(statement.text)
        if asked is not None:
            name = asked[1].upper().decode()
            if name in self.stated:
                self.parameters[name] = self.stated[name]
                self._define_again(name, self.stated[name])
            elif self._of_cycle(name).search(b"".join(line for line, _ in self._definition)):
                raise ProgramError(
                    f"{name} belongs to the cycle in force, and only the control knows the value that "
                    "FN 18 gives it; give it in [parameters] of the job file",
                    code="OLP541",
                )
            else:
                self.parameters.pop(name, None)
            return True
        given = assignment(statement.text, self.parameters)
        if given is not None:
            self.parameters[given[0]] = given[1]
            self._define_again(*given)
        return given is not None

    @staticmethod
    def _of_cycle(name: str) -> re.Pattern[bytes]:
        return re.compile(rb"(?<![A-Z])(%s[ \t]*=[ \t]*)[-+]?[\w.]+" % name.encode(), re.I)

    def _define_again(self, name: str, value: float) -> None:
        """Write the cycle in force again where a parameter of its own gets another value."""
        written, new = self._of_cycle(name), number(value)
        lines = [written.sub(lambda m: m[1] + new, line) for line, _ in self._definition]
        if lines != [line for line, _ in self._definition]:
            self._definition = list(zip(lines, (source for _, source in self._definition), strict=True))
            self.blocks += lines
            self._sources += [source for _, source in self._definition]

    def _put(self, unit: _Unit, known: int, place: int) -> None:
        """Write a statement with numbers for its parameters."""
        statement = unit.statements[place]
        cycle = cycle_of(statement)
        if cycle is not None:
            for key, text in cycle.values.items():
                name = text.upper().lstrip(b"+-").decode()
                if not name.startswith("Q") or name in self.parameters:
                    self.parameters[f"Q{key}"] = self.parameters.of(text)
        lines = [self._filled(unit.lines[k - 1]) for k in range(statement.line, unit.stop[place] + 1)]
        sources = [(known, statement.line + k) for k in range(len(lines))]
        self.blocks += lines
        self._sources += sources
        if statement.upper.startswith(b"TOOL CALL"):
            self._call_tool(of_lines(lines, statement.line))
        if cycle is not None and cycle.values and cycle.number not in AT_ONCE | PATTERNS:
            self._definition = list(zip(lines, sources, strict=True))

    def _call_tool(self, statement: Statement) -> None:
        """Q108 is the radius of the tool that is called, with DR."""
        self.radius.call(statement)
        if _RADIUS not in self.stated:
            try:
                self.parameters[_RADIUS] = self.radius.of(statement.line)
            except ProgramError:
                self.parameters.pop(_RADIUS, None)

    def _filled(self, line: bytes) -> bytes:
        body, mark, comment = line.partition(b";")

        def value(match: re.Match[bytes]) -> bytes:
            behind = body[: match.start()].rstrip()[-1:].upper()
            if match[2].upper().decode() not in self.parameters and behind and behind[0] in _KEPT_BEHIND:
                return match[0]
            text = number(self.parameters.of(match[1] + match[2]))
            return text.removeprefix(b"+") if behind in (b"F", b"S", b"R", b"L") else text

        return (_USED.sub(value, body) if b"Q" in body.upper() else body) + mark + comment
