"""What a language of robots gives beside a dialect of statements: how new targets and new moves are said."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Protocol

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass
from olp.program.dialect import StatementDialect
from olp.program.program import Program
from olp.program.robots.poses import Quaternion, zyx_of
from olp.program.robots.targets import Part, Target, Use
from olp.program.text.numbers import spliced

#: Bytes of the text from one position up to another, and what replaces them.
Replacement = tuple[int, int, bytes]


class Postures(Protocol):
    """What words of a language say of postures (`RobotDialect.fitting` and `turns_of`): a module of it."""

    def fitting(self, config: Array, axes: Array, branches: Array, /) -> tuple[Array, Mask]: ...

    def turns(
        self, config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float], /
    ) -> list[int | None]: ...


def next_number(taken: set[str], stated: Callable[[], Iterable[int]], least: int) -> int:
    """The number behind all that a text has stated, `least` or more, and behind those that were given before.
    `taken` keeps these as `#N`, so that each is found in a few steps."""
    if "#" not in taken:
        # all numbers up to the last one count as taken
        taken |= {f"#{number}" for number in range(max(stated(), default=least - 1) + 1)} | {"#"}
    low, high = least - 1, max(least, 1)
    while f"#{high}" in taken:
        high *= 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if f"#{middle}" in taken else (low, middle)
    taken.add(f"#{high}")
    return high


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotDialect(StatementDialect):
    """A language of robots. `decimals` are the fewest of a number that is changed. With `names_parts` the
    target of a part of a move needs a name. A name has `longest_name` characters at most; None: any number.
    A statement ends with its line, or where the reader says so. With `for_arms` programs are read on arms,
    too; `turn_decimals` are the fewest of a number of an orientation, and its unit is `turn_unit_rad`. Joint
    values are in units of `joint_unit_deg` and have `joint_decimals` at least. `postures` reads its words of
    postures, None where it has none."""

    decimals: int
    for_arms: bool = False
    turn_decimals: int = 6
    turn_unit_rad: float = 1.0
    joint_decimals: int = 6
    joint_unit_deg: float = 1.0
    names_parts: bool = False
    longest_name: int | None = None
    postures: Postures | None = None

    def continues(self, line: bytes) -> bool:
        return False

    def stamped(self, program: Program, stamp: bytes) -> Replacement:
        """The stamp of a correction as a line of its own."""
        raise NotImplementedError

    def named(self, program: Program, target: Target, taken: set[str]) -> str:
        """A name for a clone of a target that no other has, `taken` in capitals among them."""
        for number in count(1):
            tail = f"_olp{number}"
            room = None if self.longest_name is None else self.longest_name - len(tail)
            name = target.name[:room] + tail
            if name.upper() not in taken:
                return name
        raise AssertionError

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        """What states a part of a move before its end."""
        raise NotImplementedError

    def arc(
        self, program: Program, move: int, via: tuple[Use, Part], end: tuple[Use, Part] | None
    ) -> list[Replacement]:
        """What states a part of an arc before its end, through the via point and to the end that are given;
        None for the last part, which ends where the statement says."""
        raise NotImplementedError

    def clone(self, program: Program, target: Target, name: str, text: bytes) -> Replacement:
        """The declaration of a target again, under another name and with another value."""
        raise NotImplementedError

    def parted(
        self, program: Program, move: int, use: Use, edits: list[Replacement], close: bytes = b""
    ) -> Replacement:
        """The statement of a move with edits of its text, before the statement itself, where that has its
        lines to itself. `close` ends it."""
        data, (begin, end) = program.data, use.statement
        line = int(program.toolpath.line[move])
        lead = data[int(program.line_start[line - 1]) : begin]
        blanks = lead if not lead.strip() else b""
        own = [(a - begin, b - begin, text) for a, b, text in edits]
        return begin, begin, spliced(data[begin:end], own) + close + program.eol(line) + blanks

    def turn_values(self, turn: Quaternion, stated: Sequence[float]) -> Sequence[float]:
        """The numbers of an orientation as the language states it, those that are near `stated` ones. Where a
        language says nothing else: angles in degrees about Z, Y and X, each about an axis that is turned."""
        return zyx_of(turn, stated[0])

    def fitting(self, config: Array, axes: Array, branches: Array) -> tuple[Array, Mask]:
        """Which postures (n, 8, 6) are those that the words (n, k) of targets name: (n, 8, 6) their axis
        values with turns, and (n, 8) whether they are. A word that is NaN names all. `branches` are
        (n, 8, 4) as in `Arm.branches`."""
        if self.postures is None:
            return axes, np.isfinite(axes[:, :, 0])
        return self.postures.fitting(config, axes, branches)

    def turns_of(
        self, config: Sequence[float], nominal: Sequence[float], corrected: Sequence[float]
    ) -> list[int | None]:
        """The numbers of `Target.turns` for six corrected axis values; None for one that stays."""
        return [] if self.postures is None else self.postures.turns(config, nominal, corrected)

    def turn_texts(
        self, program: Program, target: Target, nominal: Sequence[float], corrected: Sequence[float]
    ) -> tuple[bytes, ...]:
        """What replaces the bytes of `Target.turns` for six corrected axis values."""
        new = self.turns_of(target.config, nominal, corrected)
        return tuple(
            program.data[slice(*span)] if value is None else str(value).encode()
            for span, value in zip(target.turns, new, strict=True)
        )

    def counted(self, program: Program, blocks: int) -> list[Replacement]:
        """Counts of the text, where so many statements were inserted."""
        return []

    def completed(self, program: Program, edits: list[Replacement], targets: int) -> list[Replacement]:
        """All edits of a correction, with what the language wants changed along with them. So many `targets`
        are declared beside those of the text. A number that the text leaves out has an empty span, and gets a
        text of its own here."""
        return edits


@dataclass(frozen=True, slots=True, kw_only=True)
class InPlace(RobotDialect):
    """A language whose moves state their targets in place, so that a part is the statement of its move again,
    with another value there."""

    def value(self, program: Program, part: Part, use: Use) -> bytes:
        """What states the target of a move with other numbers, and the orientation at the end of a part."""
        raise NotImplementedError

    def again(
        self, program: Program, move: int, use: Use, edits: list[Replacement], *, stop: bool
    ) -> Replacement:
        """The statement of a move with edits of its text, before the statement itself. It ends with a `stop`,
        or is passed."""
        raise NotImplementedError

    def part(self, program: Program, move: int, use: Use, part: Part) -> list[Replacement]:
        edits = [(*use.place, self.value(program, part, use))]
        return [self.again(program, move, use, edits, stop=part.stop)]

    def arc(
        self, program: Program, move: int, via: tuple[Use, Part], end: tuple[Use, Part] | None
    ) -> list[Replacement]:
        points = (via,) if end is None else (via, end)
        edits = [(*use.place, self.value(program, part, use)) for use, part in points]
        return edits if end is None else [self.again(program, move, end[0], edits, stop=False)]
