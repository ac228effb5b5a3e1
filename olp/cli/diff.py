"""What a correction changed, line by line, from the two texts: nominal, corrected, and the change in um.

Lines are aligned by their words: a line that stands in both texts differs only in its coordinates, by less
than NEAR. What has no such partner was inserted (`+`) or left out (`-`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from olp.units import AXES

#: A coordinate that moved further, in units of the program, is another point.
NEAR = 1.0
#: Insertions looked through for the partner of a line, and how far apart both texts may drift otherwise.
AHEAD = 1000
ASTRAY = 40
#: Comparisons a line before texts that have little in common are set side by side as they come.
EFFORT = 200

MAX_COLUMN = 42
_TOKEN = re.compile(r"(\([^)]*\)|;.*)|([A-Z])\s*([-+]?[\d.]+|[^\sA-Z(;]*)")
#: Words that a correction may change or add.
_GEOMETRY = frozenset("XYZIJKRFP")
_UNIT_UM = {"20": 25400.0, "21": 1000.0, "70": 25400.0, "71": 1000.0}
#: After these no coordinate of an earlier line holds: moves of the control and changes of frame.
_FORGET = frozenset(("28", "30", "92", "53", "52", "43", "49", *(str(code) for code in range(54, 60))))
#: Coordinates here are no positions of axes.
_NO_MOVE = frozenset(("4", "04", "10"))

Pair = tuple[int | None, int | None]


@dataclass(frozen=True, slots=True)
class Line:
    """A line's text, its coordinates by letter, and all words that a correction leaves alone."""

    text: str
    axes: dict[str, str]
    rest: tuple[str, ...]
    extra: frozenset[str]

    @classmethod
    def of(cls, text: str) -> Line:
        axes: dict[str, str] = {}
        rest = []
        for comment, letter, number in _TOKEN.findall(text.upper()):
            if letter in AXES and letter:
                axes[letter] = number
            elif letter not in _GEOMETRY or not letter:
                rest.append(comment or letter + number)
        return cls(text, axes, tuple(rest), frozenset(rest))

    def g_codes(self) -> frozenset[str]:
        return frozenset(word[1:].lstrip("0") or "0" for word in self.extra if word[0] == "G")


def _lines(data: bytes) -> list[Line]:
    return [Line.of(text) for text in data.decode("latin-1").splitlines()]


def _same(nominal: Line, corrected: Line) -> bool:
    """Whether one is the other, but for its coordinates. Words at the start of a split block stay on its first
    part, so its last part may have fewer of them."""
    if nominal.text == corrected.text:
        return True
    if not nominal.axes:
        return bool(nominal.rest) and nominal.rest == corrected.rest
    if not corrected.extra <= nominal.extra:
        return False
    for letter, number in nominal.axes.items():
        other = corrected.axes.get(letter)
        if other is None:
            return False
        before, after = _value(number), _value(other)
        if before is None or after is None:
            if number != other:
                return False
        elif abs(after - before) > NEAR:
            return False
    return True


def _value(number: str) -> float | None:
    try:
        return float(number)
    except ValueError:
        return None


def align(nominal: list[Line], corrected: list[Line]) -> Iterator[Pair]:
    """Indices of partners in the order of the texts; None stands where a line has no partner."""
    i = j = 0
    effort = EFFORT * (len(nominal) + 100)
    while i < len(nominal) and j < len(corrected):
        if _same(nominal[i], corrected[j]):
            skipped, inserted = 0, 0
        else:
            skipped, inserted, spent = _partner(nominal, corrected, i, j) if effort > 0 else (1, 1, 0)
            effort -= spent
        if skipped == inserted:
            yield from ((i + k, j + k) for k in range(skipped))
        else:
            yield from ((i + k, None) for k in range(skipped))
            yield from ((None, j + k) for k in range(inserted))
        i, j = i + skipped, j + inserted
        if i < len(nominal) and j < len(corrected) and _same(nominal[i], corrected[j]):
            yield i, j
            i, j = i + 1, j + 1
    yield from ((k, None) for k in range(i, len(nominal)))
    yield from ((None, k) for k in range(j, len(corrected)))


def _partner(nominal: list[Line], corrected: list[Line], i: int, j: int) -> tuple[int, int, int]:
    """How many lines of each text to pass until both agree again, fewest first, and what it took to find out."""
    spent = 0
    for total in range(1, ASTRAY):
        for skipped in range(total + 1):
            inserted = total - skipped
            if i + skipped < len(nominal) and j + inserted < len(corrected):
                spent += 1
                if _same(nominal[i + skipped], corrected[j + inserted]):
                    return skipped, inserted, spent
    for inserted in range(ASTRAY, min(AHEAD, len(corrected) - j)):
        spent += 1
        if _same(nominal[i], corrected[j + inserted]):
            return 0, inserted, spent
    return 1, 1, spent


@dataclass(slots=True)
class _Reader:
    """The few modal states that a change in um needs."""

    increments_mm: tuple[float, float, float] | None
    unit_um: float = 1000.0
    incremental: bool = False
    last: dict[str, float] = field(default_factory=dict)

    def read(self, line: Line) -> None:
        codes = line.g_codes()
        for code in codes & _UNIT_UM.keys():
            self.unit_um = _UNIT_UM[code]
        self.incremental = "91" in codes or (self.incremental and "90" not in codes)

    def deltas(self, nominal: Line, corrected: Line) -> Iterator[str]:
        for letter, text in corrected.axes.items():
            after = self._um(letter, text)
            if letter in nominal.axes:
                if nominal.axes[letter] == text:
                    continue
                before = self._um(letter, nominal.axes[letter])
            else:
                before = 0.0 if self.incremental else self.last.get(letter)
            yield f"{letter}{after - before:+.1f}" if None not in (before, after) else f"{letter} new"

    def move(self, line: Line) -> None:
        codes = line.g_codes()
        if codes & _FORGET:
            self.last.clear()
        elif not codes & _NO_MOVE:
            for letter, text in line.axes.items():
                value = self._um(letter, text)
                if value is None or self.incremental:
                    self.last.pop(letter, None)
                else:
                    self.last[letter] = value

    def _um(self, letter: str, text: str) -> float | None:
        value = _value(text)
        if value is None:
            return None
        if self.increments_mm is not None and "." not in text:
            return value * self.increments_mm[AXES.index(letter)] * 1000.0
        return value * self.unit_um
