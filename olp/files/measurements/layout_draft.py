"""A profile of a text of readings, drafted from the text: what it shows is stated, the rest is asked for.

The longest block of rows of numbers shows the mark between columns and the marks in numbers. Readings begin
at the first such rows of the text, and the line above them has the names of columns. Targets are approached
again and written alike each time; no reading repeats so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from olp.core.values import dataclass
from olp.program.text.delimited import DELIMITERS, Delimiter
from olp.program.text.rows import Form

#: What stands in the place of a value that the text does not show.
ASKED = "?"
#: Rows of numbers that show how a text is laid out, at least.
_FEWEST = 4
#: Rows of numbers one after another that may be the first readings, at least.
_FIRST = 2
#: Positions are no farther from their targets than this share of their range.
_CLOSE = 0.01
#: Marks in numbers: decimal, its name, that of thousands, and the character of these.
_MARKS = (
    (".", "point", "none", ""),
    (",", "comma", "none", ""),
    (",", "comma", "point", "."),
    (".", "point", "comma", ","),
    (",", "comma", "apostrophe", "'"),
    (".", "point", "apostrophe", "'"),
    (",", "comma", "space", " "),
)
#: A number whose comma or point may as well part groups of three digits.
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
#: Units that readings and that positions may have.
_OF_VALUES = frozenset({"mm", "um", "nm", "mrad", "urad", "arcsec", "um/m", "mm/m"})
_OF_POSITIONS = frozenset({"mm", "um", "m", "inch"})
#: Both characters for micro.
_MICRO = re.compile("[\u00b5\u03bc]")
_UNIT = re.compile(r".*[\[(]\s*(\S+?)\s*[\])]\s*")


@dataclass(frozen=True, slots=True)
class _Block:
    """Rows of numbers: the mark between columns, those in numbers (of _MARKS), (line, cells) of each row, and
    of the line above them. `first` is the line of the first rows of numbers of the text."""

    delimiter: Delimiter
    marks: tuple[str, str, str, str]
    rows: tuple[tuple[int, list[str]], ...]
    first: int
    above: tuple[int, list[str]] | None

    @property
    def named(self) -> bool:
        """Whether the line above has the names of columns."""
        if self.above is None or len(self.above[1]) != len(self.rows[0][1]):
            return False
        cells = self.above[1]
        return all(cells) and len(set(cells)) == len(cells) and not any(_is_number(cell) for cell in cells)


def drafted(text: str) -> dict[str, object] | None:
    """The keys of a profile (olp-line-profile-1), `columns` last; None where the text has no block of numbers
    in two columns, or in more of which one holds targets that are approached again."""
    blocks = [
        block
        for delimiter in ("semicolon", "tab", "comma", "space")
        for marks in _MARKS
        if DELIMITERS[delimiter] not in marks and not (delimiter == "space" and " " in marks)
        and (block := _longest(text, delimiter, marks)) is not None
    ]  # fmt: skip
    if not blocks:
        return None
    block = max(blocks, key=lambda one: len(one.rows))
    width = len(block.rows[0][1])
    if width > 2 and _columns(block)[0] is None:
        return None
    names: Sequence[object] = range(1, 1 + width)
    if block.named and block.above is not None:
        names = block.above[1]
    begin = block.above[0] if block.named and block.above is not None else block.first
    target, value = _columns(block)
    units = [_unit(str(name)) for name in names]
    grouped = all(_GROUPED.fullmatch(cell) or cell.isdigit() for _, row in block.rows for cell in row)
    keys: dict[str, object] = {
        "schema": "olp-line-profile-1",
        "delimiter": block.delimiter,
        "decimal": ASKED if grouped and _marked(block) else block.marks[1],
        "thousands": block.marks[2],
        "header_lines": begin - 1,
        "header": block.named,
        "position_unit": _among(units, target, _OF_POSITIONS),
        "unit": _among(units, value, _OF_VALUES),
        "holds": _held(block, target, value),
        "runs": "reversal",
    }
    columns = {"target": target, "value": value}
    return keys | {
        "columns": {key: ASKED if column is None else names[column] for key, column in columns.items()}
    }


def _longest(text: str, delimiter: Delimiter, marks: tuple[str, str, str, str]) -> _Block | None:
    """The longest run of rows of as many numbers, two or more; empty lines between them do not count."""
    form = Form(DELIMITERS[delimiter], (), loose=True)
    number = _pattern(marks)
    best: list[tuple[int, list[str]]] = []
    begins: list[tuple[int, int, tuple[int, list[str]] | None]] = []
    rows: list[tuple[int, list[str]]] = []
    above: tuple[int, list[str]] | None = None
    before: tuple[int, list[str]] | None = None
    for line, whole in form.lines(text):
        if not whole.strip():
            continue
        cells = form.cells(whole)
        if len(cells) > 1 and all(number.fullmatch(cell) for cell in cells):
            if rows and len(rows[0][1]) != len(cells):
                rows = []
            above = above if rows else before
            rows.append((line, cells))
            if len(rows) == _FIRST:
                begins.append((len(cells), rows[0][0], above))
            best = rows if len(rows) > len(best) else best
        else:
            rows = []
        before = line, cells
    if len(best) < _FEWEST:
        return None
    width = len(best[0][1])
    first, over = next((line, over) for count, line, over in begins if count == width)
    return _Block(delimiter, marks, tuple(best), first, over)


def _pattern(marks: tuple[str, str, str, str]) -> re.Pattern[str]:
    """What a number with these marks looks like."""
    decimal, _, _, group = marks
    whole = rf"(?:[1-9]\d{{0,2}}(?:{re.escape(group)}\d{{3}})+|\d+)" if group else r"\d+"
    return re.compile(rf"[-+]?{whole}(?:{re.escape(decimal)}\d*)?")


def _columns(block: _Block) -> tuple[int | None, int | None]:
    """The columns of targets and of readings, None where rows do not show which is which."""
    repeated = []
    width = len(block.rows[0][1])
    for column in range(width):
        cells = [row[column] for _, row in block.rows]
        counts = np.unique(cells, return_counts=True)[1]
        repeated.append(len(counts) > 1 and counts.min() > 1 and counts.min() == counts.max())
    if sum(repeated) != 1:
        return None, None
    target = repeated.index(True)
    return target, 1 - target if width == 2 else None


def _held(block: _Block, target: int | None, value: int | None) -> str:
    """Whether the readings are positions, which are close to the targets, or errors."""
    if target is None or value is None:
        return ASKED
    decimal, _, _, group = block.marks
    plain = [[cell.replace(group, "").replace(decimal, ".") for cell in row] for _, row in block.rows]
    numbers = np.array(plain).astype(float)
    off = np.abs(numbers[:, value] - numbers[:, target]).max()
    return "position" if off < _CLOSE * np.ptp(numbers[:, target]) else "error"


def _unit(name: str) -> str | None:
    """The unit in brackets behind the name of a column."""
    match = _UNIT.fullmatch(name)
    return None if match is None else _MICRO.sub("u", match[1])


def _among(units: Sequence[str | None], column: int | None, known: frozenset[str]) -> str:
    unit = None if column is None else units[column]
    return unit if unit is not None and unit in known else ASKED


def _marked(block: _Block) -> bool:
    """Whether a decimal mark stands in any number."""
    return any("." in cell or "," in cell for _, row in block.rows for cell in row)


def _is_number(cell: str) -> bool:
    return any(_pattern(marks).fullmatch(cell) for marks in _MARKS)
