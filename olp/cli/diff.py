"""What a correction changed, line by line, from the two texts: nominal, corrected, and the change in um.

Lines are aligned by their words: a line that stands in both texts differs only in its coordinates, by less
than NEAR. What has no such partner was inserted (`+`) or left out (`-`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from olp.report import printable, shortened
from olp.units import AXES

#: A coordinate that moved further, in units of the program, is another point.
NEAR = 1.0
#: Insertions looked through for the partner of a line, and how far apart both texts may drift otherwise.
AHEAD = 1000
ASTRAY = 40
#: Comparisons a line before texts that have little in common are set side by side as they come.
EFFORT = 50

MAX_COLUMN = 42
_RED, _GREEN, _DIM, _PLAIN = "\x1b[31m", "\x1b[32m", "\x1b[2m", "\x1b[0m"
_TOKEN = re.compile(r"(\([^)]*\)|;.*)|([A-Z])\s*([-+]?[\d.]+|[^\sA-Z(;]*)")
_END = re.compile(r"\r\n|\n|\r")
#: Words that hold lengths, and words besides them that a correction may change or add.
_LENGTHS = frozenset("XYZIJKR")
_FREE = frozenset("FP")
_NONE: frozenset[str] = frozenset()
_AXIS_OF = {"X": 0, "Y": 1, "Z": 2, "I": 0, "J": 1, "K": 2}
_UNIT_UM = {"20": 25400.0, "21": 1000.0, "70": 25400.0, "71": 1000.0}
#: After these no coordinate of an earlier line holds: moves of the control and changes of frame.
_FORGET = frozenset(("28", "30", "92", "53", "52", "43", "49", *(str(code) for code in range(54, 60))))
#: Coordinates here are no positions of axes.
_NO_MOVE = frozenset(("4", "10"))

Pair = tuple[int | None, int | None]


@dataclass(slots=True)
class Line:
    """A line's text, its lengths by letter, and all words that a correction leaves alone."""

    text: str
    lengths: dict[str, str]
    rest: list[str]

    @classmethod
    def of(cls, text: str) -> Line:
        lengths: dict[str, str] = {}
        rest: list[str] = []
        for comment, letter, number in _TOKEN.findall(text.upper()):
            if letter in _LENGTHS:
                lengths[letter] = number
            elif letter not in _FREE:
                rest.append(comment or letter + number)
        return cls(text, lengths, rest)

    def g_codes(self) -> frozenset[str]:
        if not self.rest:
            return _NONE
        return frozenset(word[1:].lstrip("0") or "0" for word in self.rest if word[0] == "G")


def _lines(data: bytes) -> list[Line]:
    return [Line.of(text) for text in _END.split(data.decode("latin-1"))]


def _same(nominal: Line, corrected: Line) -> bool:
    """Whether one is the other, but for its lengths. Words at the start of a split block stay on its first
    part, so its last part may have fewer of them; it also leaves out an axis that stands still."""
    if nominal.text == corrected.text:
        return True
    shared = [letter for letter in AXES if letter in nominal.lengths]
    if not shared:
        return bool(nominal.rest) and nominal.rest == corrected.rest
    shared = [letter for letter in shared if letter in corrected.lengths]
    for letter in shared:
        number, other = nominal.lengths[letter], corrected.lengths[letter]
        if number == other:
            continue
        before, after = _value(number), _value(other)
        if before is None or after is None or abs(after - before) > NEAR:
            return False
    return bool(shared) and all(word in nominal.rest for word in corrected.rest)


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
    """How many lines of each text to pass until both agree again, fewest first, and the effort spent."""
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


def render(
    before: bytes,
    after: bytes,
    *,
    increments_mm: tuple[float, float, float] | None = None,
    colour: bool = False,
) -> str:
    """The changed lines as text: line of the nominal program, nominal, corrected, change of each axis in um.

    `increments_mm` are the least increments of a control that counts them in numbers without a point.
    """
    nominal, corrected = _lines(before), _lines(after)
    rows: list[tuple[str, str, str, str]] = []
    counts = {"changed": 0, "inserted": 0, "left out": 0}
    modal = _Modal(increments_mm)
    for i, j in align(nominal, corrected):
        if i is None:
            if j is not None:
                counts["inserted"] += 1
                rows.append(("+", "", corrected[j].text, ""))
            continue
        modal.begin(nominal[i])
        if j is None:
            counts["left out"] += 1
            rows.append((f"- {i + 1}", nominal[i].text, "", ""))
        elif nominal[i].text != corrected[j].text:
            counts["changed"] += 1
            deltas = "  ".join(modal.deltas(nominal[i], corrected[j]))
            rows.append((str(i + 1), nominal[i].text, corrected[j].text, deltas))
        modal.end(nominal[i])
    total = ", ".join(f"{count} {what}" for what, count in counts.items())
    return "".join(_table(rows, colour)) + f"lines: {total}\n"


def _table(rows: list[tuple[str, str, str, str]], colour: bool) -> Iterator[str]:
    if not rows:
        return
    number = max(4, max(len(row[0]) for row in rows))
    left, right = (min(MAX_COLUMN, max(9, max(len(row[k]) for row in rows))) for k in (1, 2))
    red, green, dim, plain = (_RED, _GREEN, _DIM, _PLAIN) if colour else ("", "", "", "")
    yield f"{'line':>{number}}  {'nominal':{left}}  {'corrected':{right}}  change in um\n"
    for mark, nominal, corrected, deltas in rows:
        nominal = shortened(printable(nominal), left).ljust(left)
        corrected = shortened(printable(corrected), right)
        if deltas:
            corrected = corrected.ljust(right)
        tail = f"  {deltas}" if deltas else ""
        if colour:
            tint = red if mark[0] == "-" else dim
            yield f"{mark:>{number}}  {tint}{nominal}{plain}  {green}{corrected}{plain}{tail}\n"
        else:
            yield f"{mark:>{number}}  {nominal}  {corrected}{tail}".rstrip() + "\n"


@dataclass(slots=True)
class _Modal:
    """The few modal states that a change in um needs."""

    increments_mm: tuple[float, float, float] | None
    unit_um: float = 1000.0
    incremental: bool = False
    last: dict[str, float] = field(default_factory=dict)

    def begin(self, line: Line) -> None:
        """Units and distance mode hold from the start of the line that sets them."""
        codes = line.g_codes()
        if not codes:
            return
        for code in codes & _UNIT_UM.keys():
            self.unit_um = _UNIT_UM[code]
        self.incremental = "91" in codes or (self.incremental and "90" not in codes)

    def deltas(self, nominal: Line, corrected: Line) -> Iterator[str]:
        for letter, text in corrected.lengths.items():
            after = self._um(letter, text)
            if letter in nominal.lengths:
                if nominal.lengths[letter] == text:
                    continue
                before = self._um(letter, nominal.lengths[letter])
            else:
                before = 0.0 if self.incremental and letter in AXES else self.last.get(letter)
            if before is None or after is None:
                yield f"{letter} new"
            else:
                yield f"{letter}{after - before:+.1f}"

    def end(self, line: Line) -> None:
        """What is known of the axes behind a nominal line."""
        codes = line.g_codes()
        if codes & _FORGET:
            self.last.clear()
        elif not codes & _NO_MOVE:
            for letter in AXES:
                if letter not in line.lengths:
                    continue
                value = self._um(letter, line.lengths[letter])
                if value is None or self.incremental:
                    self.last.pop(letter, None)
                else:
                    self.last[letter] = value

    def _um(self, letter: str, text: str) -> float | None:
        value = _value(text)
        if value is None:
            return None
        if self.increments_mm is not None and "." not in text:
            return value * self.increments_mm[_AXIS_OF.get(letter, 0)] * 1000.0
        return value * self.unit_um
