"""URScript as a dialect: how a corrected program says new poses and moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import InPlace, Replacement
from olp.program.robots.poses import Quaternion, between, vector_of
from olp.program.robots.targets import NOWHERE, Part, Target, Use
from olp.program.robots.urscript import postures
from olp.program.robots.urscript.reader import POSE, read
from olp.program.robots.urscript.table import TABLE
from olp.program.text.numbers import spliced
from olp.program.text.signs import URSCRIPT

_DEF = pattern(rb"(?m)^[ \t]*def[ \t]+\w+\([^)\r\n]*\):[^\r\n]*(?:\r\n|\n|\r|\Z)")
#: A blend in metres by which a part is passed without a stop.
_PASSED = b"0.0005"


@dataclass(frozen=True, slots=True, kw_only=True)
class UrScript(InPlace):
    """URScript programs."""

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _DEF.search(program.data)
        place = 0 if match is None else match.end()
        return place, place, (b"" if match is None else b"  ") + stamp + program.eol(1)

    def again(
        self, program: Program, move: int, use: Use, edits: list[Replacement], *, stop: bool
    ) -> Replacement:
        return self.parted(program, move, use, [*edits, self._blend(program, use, stop=stop)])

    @staticmethod
    def _blend(program: Program, use: Use, *, stop: bool) -> Replacement:
        """The radius of the blend at the end of a part."""
        radius = b"0" if stop else _PASSED
        if use.zone != NOWHERE:
            return (*use.zone, radius)
        begin, end = use.statement
        close = begin + program.data[begin:end].rindex(b")")
        return close, close, b", r=" + radius

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        data, (begin, _) = program.data, target.declaration
        blanks = data[int(program.line_start[target.line - 1]) : begin]
        place = int(program.line_end[target.line - 1])
        return place, place, program.eol(target.line) + blanks + name.encode() + b"=" + text

    def turn_values(self, turn: Quaternion, stated: Sequence[float]) -> Sequence[float]:
        x, y, z = stated
        return vector_of(turn, (x, y, z))

    def value(self, program: Program, part: Part, use: Use) -> bytes:
        """The pose of a move with other numbers, and the orientation at the end of a part."""
        assert program.targets is not None
        target = program.targets.targets[use.target]
        data, start = program.data, target.value[0]
        edits = part.renumbered(target)
        if not part.turned and not (use.before == use.turn == target.turn):
            match = POSE.match(data, *target.value)
            assert match is not None
            vector = vector_of(between(use.before, use.turn, part.share))
            for k, value in zip((4, 5, 6), vector, strict=True):
                edits.append((match.start(k) - start, match.end(k) - start, f"{value:.9f}".encode()))
        return spliced(data[slice(*target.value)], edits)


DIALECT = UrScript(
    name="urscript",
    title="URScript (Universal Robots)",
    path_mode="blend radius",
    reader=read,
    signs=URSCRIPT,
    folder_endings=("script", "urscript"),
    comment=(b"# ", b""),
    languages=frozenset(("UR script",)),
    table=TABLE,
    decimals=8,
    for_arms=True,
    postures=postures,
    turn_decimals=9,
    joint_decimals=9,
    joint_unit_deg=degrees(1.0),
)
