"""The units in which reports for people show lengths: those of the files, or inches (`--units inch`).

Reports are made in mm and um. Texts and documents pass through here when they are laid out, and nowhere else
are they converted. Lengths below a millimetre have five decimals of an inch: a tenth is 0.0001 in. JSON keeps
its units, and so do findings, whose messages name keys and values of files.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from olp.core.patterns import pattern
from olp.core.units import MM_PER_INCH, UM_PER_MM

#: Choices of --units.
SYSTEMS = ("mm", "inch")

_SYSTEM: ContextVar[str] = ContextVar("units of reports", default=SYSTEMS[0])

#: By unit: its name in inches, inches of one, and decimals.
_UNITS = {
    "um": ("in", 1.0 / (UM_PER_MM * MM_PER_INCH), 5),
    "mm": ("in", 1.0 / MM_PER_INCH, 4),
    "mm/min": ("in/min", 1.0 / MM_PER_INCH, 1),
    "mm/s": ("in/s", 1.0 / MM_PER_INCH, 2),
    "mm/s2": ("in/s2", 1.0 / MM_PER_INCH, 1),
    "mm/s3": ("in/s3", 1.0 / MM_PER_INCH, 0),
}
#: Inches below which a length in mm has more decimals, and how many.
_SMALL_INCH = 0.01
_DECIMALS_OF_SMALL = 6
_NAMES = "um|mm/min|mm/s3|mm/s2|mm/s|mm"
_NUMBER = r"[<>]?[-+]*\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_PART = rf"(?:[XYZ] )?{_NUMBER}(?: to {_NUMBER})?"
#: Numbers before a unit: `0.20 um`, `0 to 600 mm`, `X 0 to 600, Y 0 to 400 mm`; not in `plate 300 mm.ngc`.
_QUANTITY = pattern(rf"(?<!line )(?<!lines )(?<![\w.])({_PART}(?:, {_PART})*) ({_NAMES})(?![\w/]|\.\w)")
#: The unit of a column or a title: its last word, or after "in".
_OF_COLUMN = pattern(rf"(?:^|[ ,])({_NAMES})(?= [XYZ]$|$)")
_IN = pattern(rf"\bin ({_NAMES})\b")
_NUMBERS = pattern(rf"{_NUMBER}(?:(?:, | to | ){_NUMBER})*")


@contextmanager
def shown_in(system: str) -> Iterator[None]:
    """Reports are laid out in these units, one of SYSTEMS, while this lasts."""
    token = _SYSTEM.set(system)
    try:
        yield
    finally:
        _SYSTEM.reset(token)


def _in_inch() -> bool:
    return _SYSTEM.get() == "inch"


def prose(text: str) -> str:
    """A sentence with its lengths in the units that are shown."""
    if not _in_inch():
        return text
    return _QUANTITY.sub(lambda match: f"{_each(match[1], match[2])} {_UNITS[match[2]][0]}", text)


def title(text: str) -> str:
    """A title that ends in `in um`, or the name of a key such as `range um`."""
    if not _in_inch():
        return text
    text = _IN.sub(lambda match: f"in {_UNITS[match[1]][0].replace('in', 'inch', 1)}", text)
    return _OF_COLUMN.sub(lambda match: match[0].replace(match[1], _UNITS[match[1]][0]), text)


def unit_in(text: str) -> str | None:
    """The unit that a title states for all numbers below it."""
    stated = _IN.search(text) or _OF_COLUMN.search(text)
    return None if stated is None else stated[1]


def value(text: str, unit: str | None) -> str:
    """A cell in a unit that its column or title states, or with units of its own."""
    if not _in_inch():
        return text
    return _each(text, unit) if unit and _NUMBERS.fullmatch(text.strip()) else prose(text)


def cells(
    header: Sequence[str], rows: Iterable[Sequence[str]], unit: str | None = None, text_columns: int = 1
) -> tuple[list[str], list[list[str]]]:
    """A table in the units that are shown. The unit of a column is that in its head, else that of its row,
    which is a cell of its own, else `unit`, else that of the first head. Where the head states none, integers
    are counts and lines."""
    body = [list(row) for row in rows]
    if not _in_inch():
        return list(header), body
    whole = unit or (_IN.search(header[0]) is not None and unit_in(header[0])) or None
    units = [_OF_COLUMN.search(head) for head in header]
    for row in body:
        own = next((cell for cell in row if cell in _UNITS), None)
        for k, cell in enumerate(row):
            head = units[k]
            if cell in _UNITS:
                row[k] = _UNITS[cell][0]
            elif head is not None and _IN.search(header[k]) is None:
                row[k] = value(cell, head[1])
            elif k >= text_columns and "." in cell and not re.search(r"\b(u?rad|deg|s|%)$", header[k]):
                row[k] = value(cell, own or whole)
            else:
                row[k] = prose(cell)
    return [title(head) for head in header], body


def _each(text: str, unit: str) -> str:
    """Every number of a text, from a unit to inches."""
    _, factor, most = _UNITS[unit]

    def converted(match: re.Match[str]) -> str:
        digits = match[0].lstrip("<>+-")
        sign = match[0].removesuffix(digits)
        inches = float(digits) * factor
        decimals = most if abs(inches) >= _SMALL_INCH or unit == "um" else _DECIMALS_OF_SMALL
        shown = f"{inches:.{decimals}f}"
        if inches and not float(shown):
            shown = f"{10.0**-decimals:.{decimals}f}"
            sign = sign if sign[:1] in ("<", ">") else ">-" if sign == "-" else f"<{sign}"
        if unit != "um" and "." in shown:
            shown = shown.rstrip("0").rstrip(".")
        return f"{sign}{shown}"

    return re.sub(_NUMBER, converted, text)
