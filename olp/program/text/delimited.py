"""Tables of positions as text: the layout of one, and how it is detected from its first rows.

A layout is a value. It comes from a profile (`olp.files.point_profile`) or from the first rows of a table
(`detected_layout`); then it says in words what it assumes. `olp.program.text.rows` reads the table.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Literal

from olp.core.errors import InputError
from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.core.values import dataclass

Delimiter = Literal["comma", "semicolon", "tab", "space"]

#: mm per unit of length
MM = {"mm": 1.0, "um": 1e-3, "m": 1e3, "inch": 25.4}
#: seconds per unit of time
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
#: mm/s per unit of speed
MM_S = {"mm/s": 1.0, "mm/min": 1 / 60, "m/s": 1e3, "m/min": 1e3 / 60, "inch/min": 25.4 / 60}
#: "space" is any run of blanks
DELIMITERS: dict[str, str | None] = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}

#: what a column may hold, and its names in a header (in lower case, without their unit)
ROLES: dict[str, tuple[str, ...]] = {
    "X": ("x",),
    "Y": ("y",),
    "Z": ("z",),
    "t": ("t", "time"),
    "name": ("name", "point", "tag", "label"),
    "line": ("line",),
    "A": ("a", "rx", "roll", "yaw"),
    "B": ("b", "ry", "pitch"),
    "C": ("c", "rz"),
    "I": ("i", "nx"),
    "J": ("j", "ny"),
    "K": ("k", "nz"),
    "speed": ("speed", "feed", "feedrate", "velocity"),
    "blend": ("blend", "zone", "rounding"),
    "tool": ("tool", "stylus", "sensor"),
    "SX": ("sx", "stylus_x"),
    "SY": ("sy", "stylus_y"),
    "SZ": ("sz", "stylus_z"),
}
AXES = ("X", "Y", "Z")

#: rows that a layout is detected from
LOOK = 40
#: bytes that have these rows
_HEAD = 1 << 16
_FRAME = pattern(r"[#/%;\s]*frame\s*=\s*(\S+)", re.IGNORECASE)
_NUMBER = pattern(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_COMMA_NUMBER = pattern(r"[-+]?\d+,\d+")
_AXIS = pattern(r"([xyz])(?:[ _]*[\[(]?(mm|um|m|inch)[\])]?)?")
_OTHER = pattern(r"(.+?)(?:(?:[ _]+|[ _]*[\[(])(?:mm|deg|rad|s|ms|us|(?:mm|m|inch)[/_](?:s|min))[\])]?)?")
_SPEED = pattern(r".+?[ _]*[\[(]?(mm|m|inch)[/_](s|min)[\])]?")
_MARKS = ("#", "//", "%")


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a table. `columns` leads from what a column holds (ROLES) to its name or its number
    from 1. `unit` is that of X, Y and Z, None where nothing states it. `point` is what a row of measured
    points states: a point on the surface or the centre of the tip. `assumed` says in words what was
    detected from the rows."""

    columns: Mapping[str, str | int]
    delimiter: Delimiter = "comma"
    decimal: Literal["point", "comma"] = "point"
    unit: str | None = None
    time_unit: str = "s"
    speed_unit: str | None = None
    header: bool = True
    comment: str = "#"
    frame: str | None = None
    point: Literal["surface", "centre"] | None = None
    tip_radius_mm: float | None = None
    approach_mm: float | None = None
    joined: Literal["points", "lines"] = "points"
    insert: bool = False
    stamp: bool = True
    assumed: tuple[str, ...] = field(default=())

    @property
    def unit_mm(self) -> float:
        """mm per unit of X, Y and Z. Raises InputError where nothing states the unit."""
        if self.unit is None:
            raise InputError(
                "states no unit of X, Y and Z; give it in the header (X_mm or `X [inch]`), with the key unit "
                "of a profile, or with --unit of olp correct, results or compare"
            )
        return MM[self.unit]


def mapping(columns: Mapping[str, str | int]) -> Mapping[str, str | int]:
    """Columns as a mapping that cannot be changed."""
    return MappingProxyType(dict(columns))


def detected_layout(lines: Sequence[str]) -> Layout | None:
    """The layout that the first rows of a table show, None where they leave a choice.

    The rows have a header that names X, Y and Z, with or without their unit; or names and three numbers, as
    SpatialAnalyzer writes them; or three numbers and nothing else.
    """
    comment = next((m for m in _MARKS[1:] if any(line.lstrip().startswith(m) for line in lines)), "#")
    rows = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith(("#", comment))]
    if not rows:
        return None
    delimiter = _delimiter(rows)
    cells = [_split(row, delimiter) for row in rows]
    decimal: Literal["point", "comma"] = "point"
    if any(_COMMA_NUMBER.fullmatch(c) for row in cells for c in row):
        decimal = "comma"
    assumed = [f"columns are separated by {delimiter}"]
    if decimal == "comma":
        assumed.append("the decimal mark is a comma")
    named = _named(cells[0])
    if named is not None:
        columns, unit = named
        assumed.append(_columns_text(columns, unit))
        speed = _SPEED.fullmatch(str(columns.get("speed", "")).lower())
        return Layout(
            mapping(columns), delimiter, decimal, unit, comment=comment, assumed=tuple(assumed),
            speed_unit=None if speed is None else f"{speed[1]}/{speed[2]}",
        )  # fmt: skip
    number = [bool(_NUMBER.fullmatch(c.replace(",", "."))) for c in cells[0]]
    columns = {}
    if number == [True] * 3:
        columns = {"X": 1, "Y": 2, "Z": 3}
    text = next((i for i, is_number in enumerate(number) if is_number), 0)
    # a point may be named by a number: the layout is three numbers at the end, after a word
    if text and all(number[text:]) and len(number) - 3 in (text, text + 1):
        x = len(number) - 2
        columns = {"X": x, "Y": x + 1, "Z": x + 2, "name": x - 1}
    if not columns:
        return None
    assumed.append(_columns_text(columns, None))
    return Layout(
        mapping(columns), delimiter, decimal, None, header=False, comment=comment, assumed=tuple(assumed)
    )


def first_lines(data: Text) -> list[str]:
    """The first rows of a text, from which its layout is detected."""
    head = data[:_HEAD].decode("utf-8-sig", "replace").replace("\r\n", "\n").replace("\r", "\n")
    if len(data) > _HEAD:
        # the last line may be cut
        head = head[: head.rfind("\n") + 1] or head
    return head.split("\n")[:LOOK]


def stated_frame(lines: Sequence[str], file: str = "") -> str | None:
    """The frame that a comment among the first rows names, as in `# frame=G54`. Raises InputError, with its
    line, for a second one that differs."""
    stated = None
    for number, line in enumerate(lines, 1):
        match = _FRAME.match(line)
        if match and stated not in (None, match[1]):
            raise InputError(
                f"the frame is {match[1]} here and {stated} before; expected one frame per file",
                file=file or None, line=number,
            )  # fmt: skip
        stated = match[1] if match else stated
    return stated


def _columns_text(columns: Mapping[str, str | int], unit: str | None) -> str:
    named = ", ".join(f"{role} in column {column}" for role, column in columns.items())
    return f"{named}; {f'in {unit}' if unit else 'no unit is stated'}"


def _delimiter(rows: Sequence[str]) -> Delimiter:
    row = rows[-1]
    if ";" in row:
        return "semicolon"
    if "\t" in row:
        return "tab"
    decimal_commas = sum(bool(_COMMA_NUMBER.fullmatch(cell)) for cell in row.split())
    return "comma" if "," in row and decimal_commas < 3 else "space"


def _split(row: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in row.split(DELIMITERS[delimiter])]


def _named(header: Sequence[str]) -> tuple[dict[str, str | int], str | None] | None:
    """Columns whose names say what they hold, and the unit of X, Y and Z in them."""
    columns: dict[str, str | int] = {}
    units: set[str] = set()
    for role, names in ROLES.items():
        for cell in header:
            match = (_AXIS if role in AXES else _OTHER).fullmatch(cell.lower())
            if match is None or match[1] not in names:
                continue
            if role in AXES and match[2]:
                units.add(match[2])
            columns[role] = cell
            break
    if not set(AXES) <= columns.keys() or len(units) > 1:
        return None
    return columns, next(iter(units), None)
