"""What a correction changed, line by line, from the two texts: nominal, corrected, and the change in um.

Two lines are partners where both leave the axes at the same position, as far as their words state it, and
the corrected line has no other words than the nominal one. A line without partner was inserted (`+`) or left
out (`-`); of a split block the last part is the partner.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from olp.core.units import AXES
from olp.core.values import dataclass
from olp.program.text.line_ends import LINE_END_TEXT
from olp.reports.report import printable, shortened

#: Insertions, in lines, that are searched for the partner of a line.
AHEAD = 1000
#: Lines by which both texts may be out of step where lines were not only inserted.
ASTRAY = 40
#: Mean comparisons per line; beyond that the texts have little in common and are listed side by side.
EFFORT = 50

#: Characters of a column of program text.
MAX_COLUMN = 42
_RED = "\x1b[31m"
_GREEN = "\x1b[32m"
_DIM = "\x1b[2m"
_PLAIN = "\x1b[0m"

_TOKEN = re.compile(r"(\([^)]*\)|;.*)|([A-Z])\s*([-+]?[\d.]+|[^\sA-Z(;]*)")
#: Letters of words that hold lengths.
_LENGTHS = frozenset("XYZIJKR")
#: Letters of further words that a correction may change or add.
_FREE = frozenset("FP")
_AXIS_OF = {"X": 0, "Y": 1, "Z": 2, "I": 0, "J": 1, "K": 2, "R": 0}
#: Unit of lengths in um, by G code.
_UNIT_UM = {"20": 25400.0, "21": 1000.0, "70": 25400.0, "71": 1000.0}
#: G codes after which the position is unknown: moves of the control, changes of frame, cycles.
_FORGET = frozenset(
    str(code)
    for code in (28, 30, 43, 44, 49, 52, 53, *range(54, 60), 73, 74, 76, *range(81, 90), 92.1, 92.2, 92.3)
)
#: G codes whose coordinates are not positions of axes.
_NO_MOVE = frozenset(("4", "10"))
#: Statements that state a point or a centre.
_POINT = re.compile(r"\s*(GOTO|GODLTA|PTMEAS|CIRCLE|MOVARC)\s*/(?:\s*CART\s*,)?(.*)")
#: Statements that state the unit of numbers.
_UNITS = re.compile(r"\s*UNITS?\s*/\s*(INCH|MM)")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_UNKNOWN = (math.nan, math.nan, math.nan)

#: mm per unit of a number without a point, by letter and unit in mm.
BareMm = Callable[[str, float], float]
Position = tuple[float, float, float]
Pair = tuple[int | None, int | None]


@dataclass(slots=True)
class Line:
    """A line's text, its lengths in um by letter, the words that a correction never changes, and the position
    in um where its words leave the axes."""

    text: str
    lengths: dict[str, float]
    rest: list[str]
    position_um: Position = _UNKNOWN


class _Reader:
    """Reads lines with the few modal states that lengths need."""

    def __init__(self, bare_mm: BareMm | None = None) -> None:
        self._bare_mm = bare_mm
        self._unit_um = 1000.0
        self._incremental = False
        self._position = _UNKNOWN

    def read(self, data: bytes) -> list[Line]:
        return [self._line(text) for text in LINE_END_TEXT.split(data.decode("latin-1"))]

    def _line(self, text: str) -> Line:
        words: list[tuple[str, str]] = []
        rest: list[str] = []
        for comment, letter, number in _TOKEN.findall(text.upper()):
            if letter in _LENGTHS:
                words.append((letter, number))
            elif letter not in _FREE:
                rest.append(comment or letter + number)
        codes = [word[1:].lstrip("0") or "0" for word in rest if word[0] == "G"]
        for code in codes:
            self._unit_um = _UNIT_UM.get(code, self._unit_um)
            self._incremental = code == "91" or (self._incremental and code != "90")
        line = Line(text, {letter: self._um(letter, number) for letter, number in words}, rest)
        if _NO_MOVE.isdisjoint(codes):
            self._move(line, "92" in codes)
        line.position_um = self._position
        if not _FORGET.isdisjoint(codes):
            self._position = _UNKNOWN
        return line

    def _move(self, line: Line, is_set: bool) -> None:
        position = list(self._position)
        for letter, value in line.lengths.items():
            if letter in AXES:
                axis = _AXIS_OF[letter]
                position[axis] = position[axis] + value if self._incremental and not is_set else value
        self._position = (position[0], position[1], position[2])

    def _um(self, letter: str, number: str) -> float:
        try:
            value = float(number)
        except ValueError:
            return math.nan
        if self._bare_mm is not None and "." not in number:
            return value * self._bare_mm(letter, self._unit_um / 1000.0) * 1000.0
        return value * self._unit_um


class _StatementReader:
    """Reads lines of statements (APT, DMIS) that state a point or a centre."""

    def __init__(self) -> None:
        self._unit_um = 1000.0

    def read(self, data: bytes) -> list[Line]:
        return [self._line(text) for text in LINE_END_TEXT.split(data.decode("latin-1"))]

    def _line(self, text: str) -> Line:
        statement = _POINT.match(text.upper())
        if statement is None:
            if unit := _UNITS.match(text.upper()):
                self._unit_um = 25400.0 if unit[1] == "INCH" else 1000.0
            return Line(text, {}, [text] if text.strip() else [])
        values = [float(n) * self._unit_um for n in _NUMBER.findall(statement[2])[:3]]
        lengths = dict(zip(AXES, values, strict=False))
        position = _UNKNOWN
        if len(values) == 3 and statement[1] != "GODLTA":
            position = (values[0], values[1], values[2])
        return Line(text, lengths, [statement[1]], position)


def _same(nominal: Line, corrected: Line, near_um: float) -> bool:
    if nominal.text == corrected.text:
        return True
    if not (nominal.lengths and corrected.lengths):
        return bool(nominal.rest) and nominal.rest == corrected.rest and not nominal.lengths
    for here, there in zip(nominal.position_um, corrected.position_um, strict=True):
        # An unknown position agrees with any other.
        if abs(here - there) > near_um:
            return False
    return all(word in nominal.rest for word in corrected.rest)


def align(nominal: list[Line], corrected: list[Line], near_um: float) -> Iterator[Pair]:
    """Indices of partners in the order of the texts; None where a line has no partner."""
    i = j = 0
    effort = EFFORT * (len(nominal) + 100)
    while i < len(nominal) and j < len(corrected):
        if not _same(nominal[i], corrected[j], near_um):
            skipped, inserted, spent = (1, 1, 0)
            if effort > 0:
                skipped, inserted, spent = _partner(nominal, corrected, i, j, near_um)
            effort -= spent
            if skipped == inserted:
                yield from ((i + k, j + k) for k in range(skipped))
            else:
                yield from ((i + k, None) for k in range(skipped))
                yield from ((None, j + k) for k in range(inserted))
            i, j = i + skipped, j + inserted
        else:
            yield i, j
            i, j = i + 1, j + 1
    yield from ((k, None) for k in range(i, len(nominal)))
    yield from ((None, k) for k in range(j, len(corrected)))


def _partner(
    nominal: list[Line], corrected: list[Line], i: int, j: int, near_um: float
) -> tuple[int, int, int]:
    """How many lines of each text to skip until both agree again, fewest first, and the effort spent.

    Insertions come first: a correction leaves no line out.
    """
    spent = 0
    for inserted in range(1, min(AHEAD, len(corrected) - j)):
        spent += 1
        if _same(nominal[i], corrected[j + inserted], near_um):
            return 0, inserted, spent
    for total in range(1, ASTRAY):
        for skipped in range(1, total + 1):
            inserted = total - skipped
            if i + skipped < len(nominal) and j + inserted < len(corrected):
                spent += 1
                if _same(nominal[i + skipped], corrected[j + inserted], near_um):
                    return skipped, inserted, spent
    return 1, 1, spent


def render(
    nominal_data: bytes,
    corrected_data: bytes,
    *,
    near_um: float = 1000.0,
    bare_mm: BareMm | None = None,
    statements: bool = False,
    place: Callable[[int], str] = str,
    colour: bool = False,
) -> str:
    """The changed lines as text: line in the nominal program, nominal, corrected, change of lengths in um.

    The change of an axis is corrected command minus nominal command. No correction is larger than `near_um`.
    `bare_mm` is what the control takes numbers without a point for; without it they are as with one.
    `statements`: the texts are APT or DMIS. `place` puts a line of the nominal text into words.
    """
    nominal, corrected = (
        (_StatementReader() if statements else _Reader(bare_mm)).read(data)
        for data in (nominal_data, corrected_data)
    )

    def changes(i: int, j: int) -> str:
        return "  ".join(_changes(nominal[i], corrected[j], near_um))

    texts = [line.text for line in nominal], [line.text for line in corrected]
    return listed(*texts, align(nominal, corrected, near_um), changes, place=place, colour=colour)


def listed(
    nominal: Sequence[str], corrected: Sequence[str], pairs: Iterable[Pair],
    changes: Callable[[int, int], str], *, place: Callable[[int], str] = str, colour: bool = False,
    unit: str = "um",
) -> str:  # fmt: skip
    """The partners among lines of two texts whose text differs, and lines without partner, as a table.
    `changes` puts into words what differs between two partners, in a `unit`."""
    rows: list[tuple[str, str, str, str]] = []
    counts = {"changed": 0, "inserted": 0, "left out": 0}
    for i, j in pairs:
        if i is None:
            if j is not None:
                counts["inserted"] += 1
                rows.append(("+", "", corrected[j], ""))
        elif j is None:
            counts["left out"] += 1
            rows.append((f"- {place(i + 1)}", nominal[i], "", ""))
        elif nominal[i] != corrected[j]:
            counts["changed"] += 1
            rows.append((place(i + 1), nominal[i], corrected[j], changes(i, j)))
    total = ", ".join(f"{count} {what}" for what, count in counts.items())
    return "".join(_table(rows, colour, unit)) + f"lines: {total}\n"


def _changes(nominal: Line, corrected: Line, near_um: float) -> Iterator[str]:
    for letter, value in corrected.lengths.items():
        if letter in AXES:
            axis = _AXIS_OF[letter]
            change = corrected.position_um[axis] - nominal.position_um[axis]
            if change == 0.0 and nominal.lengths.get(letter) == value:
                continue
        else:
            change = value - nominal.lengths.get(letter, math.nan)
            # The centre of the last part of a split arc is stated from its own start.
            if change == 0.0 or not abs(change) <= near_um:
                continue
        yield f"{letter} new" if math.isnan(change) else f"{letter}{change:+.1f}"


def _table(rows: list[tuple[str, str, str, str]], colour: bool, unit: str) -> Iterator[str]:
    if not rows:
        return
    number = max(4, max(len(row[0]) for row in rows))
    nominal_width, corrected_width = (
        min(MAX_COLUMN, max(9, max(len(row[k]) for row in rows))) for k in (1, 2)
    )
    heads = f"{'line':>{number}}  {'nominal':{nominal_width}}  {'corrected':{corrected_width}}"
    yield f"{heads}  change in {unit}\n"
    for mark, nominal, corrected, changes in rows:
        nominal = shortened(printable(nominal), nominal_width).ljust(nominal_width)
        corrected = shortened(printable(corrected), corrected_width)
        if changes:
            corrected = corrected.ljust(corrected_width)
        tail = f"  {changes}" if changes else ""
        if colour:
            tint = _RED if mark[0] == "-" else _DIM
            yield f"{mark:>{number}}  {tint}{nominal}{_PLAIN}  {_GREEN}{corrected}{_PLAIN}{tail}\n"
        else:
            yield f"{mark:>{number}}  {nominal}  {corrected}{tail}".rstrip() + "\n"
