"""VAL 3 as a dialect: how a corrected application says new targets and new moves."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

from olp.core.arrays import Array, Mask
from olp.core.patterns import pattern
from olp.core.spool import whole
from olp.core.values import dataclass
from olp.program.program import Program
from olp.program.robots.dialect import Replacement, RobotDialect
from olp.program.robots.poses import Quaternion, between
from olp.program.robots.targets import NOWHERE, Part, Target, Use
from olp.program.robots.val3 import postures, writing
from olp.program.robots.val3.data import TRANSFORM
from olp.program.robots.val3.reader import read
from olp.program.robots.val3.table import TABLE
from olp.program.robots.val3.values import REFERENCE, xyz_of
from olp.program.text.numbers import spliced
from olp.program.text.signs import VAL3

_HEAD = pattern(rb"\A(?:\xef\xbb\xbf)?\s*(?:<\?xml.*?\?>)?[ \t]*(?:\r*\n|\r)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Val3(RobotDialect):
    """Applications of VAL 3."""

    def comment_marks(self) -> tuple[tuple[bytes, bytes], ...]:
        return ((b"//", b""), (b"<!--", b"-->"))

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        match = _HEAD.match(whole(program.data))
        assert match is not None
        return match.end(), match.end(), stamp + program.eol(1)

    def named(self, program: Program, target: Target, taken: set[str]) -> str:
        """The next element of a target's data."""
        first = writing.following(whole(program.data)).get(target.name)
        if first is None:
            return ""
        base, span = target.name.upper(), 1
        while f"{base}[{first + span - 1}]" in taken:
            span *= 2
        low, high = first + span // 2 - 1, first + span - 1
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if f"{base}[{middle}]" in taken else (low, middle)
        return f"{target.name}[{high}]"

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        value, found = self._stated(program, use, part)
        return [self._before(program, move, use, [(*use.place, value)], stop=part.stop), *found]

    def arc(
        self, program: Program, move: int, via: tuple[Use, Part], end: tuple[Use, Part] | None
    ) -> list[Replacement]:
        value, found = self._stated(program, *via)
        first = (*via[0].place, value)
        if end is None:
            return [first, *found]
        value, more = self._stated(program, *end)
        own = self._before(program, move, end[0], [first, (*end[0].place, value)], stop=False)
        return [own, *found, *more]

    def _stated(self, program: Program, use: Use, part: Part) -> tuple[bytes, list[Replacement]]:
        """What states a target of its own in the place of a move, and the edits of the data for it."""
        data, targets = whole(program.data), program.targets
        assert targets is not None
        target, (begin, end) = targets.targets[use.target], use.statement
        texts = [*part.numbers, *self._angles(data, target, use, part)]
        if begin <= target.numbers[0][0] < end:
            a, b = (begin, end) if use.place == use.statement else target.value
            spans = (*target.numbers, *target.turned)
            numbers = [(c - a, d - a, text) for (c, d), text in zip(spans, texts, strict=True)]
            return spliced(data[a:b], numbers), []
        datum, entry = writing.declared_at(data, target)
        names = tuple(entry.slots) if target.joints else TRANSFORM
        named = {name: text for name, text in zip(names, texts, strict=True) if text}
        index = part.name.partition("[")[2].rstrip("]")
        return part.name.encode(), [writing.element(data, datum, entry, index, named)]

    @staticmethod
    def _before(
        program: Program, move: int, use: Use, edits: list[Replacement], *, stop: bool
    ) -> Replacement:  # fmt: skip
        """The statement of a move again, before it and with edits of its text. Parts pass without a stop."""
        data, (begin, end) = whole(program.data), use.statement
        first: list[bytes] = []
        if use.zone != NOWHERE:
            motion = REFERENCE.fullmatch(data, *use.zone)
            assert motion is not None
            index = "0" if motion[2] is None else motion[2].strip().decode()
            passing = writing.passing(motion[1].decode(), index)
            edits = [*edits, (*use.zone, passing)]
            if writing.is_assigned(data, motion[1]):
                first = writing.copied(passing, data[slice(*use.zone)])
        line = int(program.toolpath.line[move])
        blanks = data[int(program.line_start[line - 1]) : begin]
        blanks = blanks if not blanks.strip() else b""
        behind = program.eol(line) + blanks
        own = spliced(data[begin:end], [(a - begin, b - begin, text) for a, b, text in edits])
        lines = [*first, own, *([b"waitEndMove()"] if stop else [])]
        return begin, begin, b"".join(one + behind for one in lines)

    @staticmethod
    def _angles(data: bytes, target: Target, use: Use, part: Part) -> list[bytes]:
        """The numbers of the orientation at the end of a part."""
        if part.turned:
            return list(part.turned)
        if use.before == use.turn == target.turn:
            return [data[a:b] for a, b in target.turned]
        return [b"%.6f" % angle for angle in xyz_of(between(use.before, use.turn, part.share))]

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        data = whole(program.data)
        datum, entry = writing.declared_at(data, target, whole=True)
        index = name.partition("[")[2].rstrip("]")
        return writing.element(data, datum, entry, index, writing.numbers_of(data, entry, text))

    def turn_values(self, turn: Quaternion, stated: Sequence[float]) -> Sequence[float]:
        return xyz_of(turn, stated[2])

    def fitting(self, config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
        return postures.fitting(config, axes, branches)

    def completed(self, program: Program, edits: list[Replacement], targets: int) -> list[Replacement]:
        return writing.completed(whole(program.data), edits)


DIALECT = Val3(
    name="staubli-val3",
    title="VAL 3 (Stäubli)",
    path_mode="blend",
    reader=read,
    signs=VAL3,
    folder_endings=("pjx",),
    comment=(b"<!-- ", b" -->"),
    languages=frozenset(("Stäubli VAL 3", "a web page or XML")),
    table=TABLE,
    decimals=6,
    names_parts=True,
    for_arms=True,
    turn_decimals=6,
    turn_unit_rad=radians(1.0),
)
