"""A profile of a text of readings, drafted from the text: what it shows is stated, the rest is asked for.

The longest block of rows of two numbers shows the mark between columns and the decimal mark. The line above
it has the names of columns. Targets are approached again and written alike each time; no reading repeats so.
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
#: Rows of numbers that are a block, at least.
_FEWEST = 4
#: Positions are no farther from their targets than this share of their range.
_CLOSE = 0.01
#: Decimal marks, and what a number with each looks like.
_DECIMALS = {"point": re.compile(r"[-+]?\d+(\.\d*)?"), "comma": re.compile(r"[-+]?\d+(,\d*)?")}
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
    """Rows of numbers: the mark between columns, the decimal mark, (line, cells) of each row, and of the line
    above them."""

    delimiter: Delimiter
    decimal: str
    rows: tuple[tuple[int, list[str]], ...]
    above: tuple[int, list[str]] | None

    @property
    def named(self) -> bool:
        """Whether the line above has the names of columns."""
        if self.above is None or len(self.above[1]) != len(self.rows[0][1]):
            return False
        cells = self.above[1]
        return all(cells) and len(set(cells)) == len(cells) and not any(_is_number(cell) for cell in cells)


def drafted(text: str) -> dict[str, object] | None:
    """The keys of a profile (olp-line-profile-1), `columns` last; None where the text has no block of two
    columns of numbers."""
    blocks = [
        block
        for delimiter in ("semicolon", "tab", "comma", "space")
        for decimal in _DECIMALS
        if (delimiter, decimal) != ("comma", "comma")
        and (block := _longest(text, delimiter, decimal)) is not None
    ]
    if not blocks:
        return None
    block = max(blocks, key=lambda one: len(one.rows))
    names: Sequence[object] = range(1, 1 + len(block.rows[0][1]))
    if block.named and block.above is not None:
        names = block.above[1]
    begin = block.above[0] if block.named and block.above is not None else block.rows[0][0]
    target, value = _columns(block)
    units = [_unit(str(name)) for name in names]
    grouped = all(_GROUPED.fullmatch(cell) or cell.isdigit() for _, row in block.rows for cell in row)
    keys: dict[str, object] = {
        "schema": "olp-line-profile-1",
        "delimiter": block.delimiter,
        "decimal": ASKED if grouped and _marked(block) else block.decimal,
        "header_lines": begin - 1,
        "header": block.named,
        "position_unit": _among(units, target, _OF_POSITIONS),
        "unit": _among(units, value, _OF_VALUES),
        "holds": _held(block, target),
        "runs": "reversal",
    }
    columns = {"target": target, "value": value}
    return keys | {
        "columns": {key: ASKED if column is None else names[column] for key, column in columns.items()}
    }


def _longest(text: str, delimiter: Delimiter, decimal: str) -> _Block | None:
    """The longest run of rows of two numbers; empty lines between them do not count."""
    form = Form(DELIMITERS[delimiter], (), loose=True)
    number = _DECIMALS[decimal]
    best: _Block | None = None
    rows: list[tuple[int, list[str]]] = []
    above: tuple[int, list[str]] | None = None
    before: tuple[int, list[str]] | None = None
    for line, whole in form.lines(text):
        if not whole.strip():
            continue
        cells = form.cells(whole)
        if len(cells) == 2 and all(number.fullmatch(cell) for cell in cells):
            above = above if rows else before
            rows.append((line, cells))
            if len(rows) >= _FEWEST and (best is None or len(rows) > len(best.rows)):
                best = _Block(delimiter, decimal, tuple(rows), above)
        else:
            rows = []
        before = line, cells
    return best


def _columns(block: _Block) -> tuple[int | None, int | None]:
    """The columns of targets and of readings, None where rows do not show which is which."""
    repeated = []
    for column in range(2):
        cells = [row[column] for _, row in block.rows]
        counts = np.unique(cells, return_counts=True)[1]
        repeated.append(len(counts) > 1 and counts.min() > 1 and counts.min() == counts.max())
    if repeated[0] == repeated[1]:
        return None, None
    return (0, 1) if repeated[0] else (1, 0)


def _held(block: _Block, target: int | None) -> str:
    """Whether the readings are positions, which are close to the targets, or errors."""
    if target is None:
        return ASKED
    numbers = np.array([[float(cell.replace(",", ".")) for cell in row] for _, row in block.rows])
    off = np.abs(numbers[:, 1] - numbers[:, 0]).max()
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
    return any(number.fullmatch(cell) for number in _DECIMALS.values())
