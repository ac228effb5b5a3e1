"""RAPID as a dialect: how a corrected program says new targets and moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import InPlace, Replacement
from olp.program.robots.poses import Quaternion, between
from olp.program.robots.rapid import postures
from olp.program.robots.rapid.reader import read
from olp.program.robots.rapid.table import TABLE
from olp.program.robots.rapid.values import ROBTARGET
from olp.program.robots.targets import Part, Target, Use
from olp.program.text.numbers import spliced
from olp.program.text.signs import RAPID

_MODULE = pattern(rb"(?im)^[ \t]*MODULE\s+\w+(?:\s*\([^)]*\))?[^\r\n]*(?:\r\n|\n|\r|\Z)")
_DECLARED_NAME = pattern(rb"(?is)((?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+(?:rob|joint)target\s+)\w+")
#: A zone through which the robot passes without a stop.
_PASSED = b"z0"
#: A zone at which it stops: a step that takes up backlash is smaller than any other.
_STOP = b"fine"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rapid(InPlace):
    """RAPID programs."""

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _MODULE.search(program.data)
        place = 0 if match is None else match.end()
        return place, place, stamp + program.eol(1)

    def again(
        self, program: Program, move: int, use: Use, edits: list[Replacement], *, stop: bool
    ) -> Replacement:
        edits = [*edits, (*use.zone, _STOP if stop else _PASSED)]
        return self.parted(program, move, use, edits, b";")

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        data = program.data
        begin, end = target.declaration
        lead = _DECLARED_NAME.match(data, begin, end)
        if lead is None:
            raise ProgramError(
                f"{target.name} is assigned by a statement, and its moves want different numbers of it; give "
                "each move its own target",
                line=target.line,
                code="OLP561",
            )
        line = int(program.line_start[target.line - 1])
        blanks = data[line:begin] if not data[line:begin].strip() else b""
        # the line of the semicolon
        eol, last = program.eol(target.line), int(np.searchsorted(program.line_start, end, "right")) - 1
        place = int(program.line_end[last])
        return place, place, eol + blanks + lead[1] + name.encode() + b":=" + text + b";"

    def turn_values(self, turn: Quaternion, stated: Sequence[float]) -> Sequence[float]:
        against = sum(a * b for a, b in zip(turn, stated, strict=True)) < 0.0
        return tuple(-value for value in turn) if against else turn

    def value(self, program: Program, part: Part, use: Use) -> bytes:
        """The target of a move with other numbers, and the orientation at the end of a part."""
        assert program.targets is not None
        target = program.targets.targets[use.target]
        data, start = program.data, target.value[0]
        edits = part.renumbered(target)
        if not part.turned and not (use.before == use.turn == target.turn):
            match = ROBTARGET.match(data, *target.value)
            assert match is not None
            turn = between(use.before, use.turn, part.share)
            spans = [match.span(k) for k in range(4, 8)]
            edits += [
                (a - start, b - start, f"{v:.9f}".encode()) for (a, b), v in zip(spans, turn, strict=True)
            ]
        return spliced(data[slice(*target.value)], edits)


DIALECT = Rapid(
    name="abb-rapid",
    title="RAPID (ABB)",
    path_mode="zone",
    reader=read,
    signs=RAPID,
    folder_endings=("mod", "modx", "prg", "sysx", "pgf"),
    comment=(b"! ", b""),
    languages=frozenset(("ABB RAPID", "a web page or XML")),
    table=TABLE,
    decimals=4,
    for_arms=True,
    postures=postures,
    turn_decimals=9,
    turn_unit_rad=2.0,
    longest_name=32,
)
