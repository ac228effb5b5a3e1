"""How a file of measured points is laid out: profiles as TOML files, built-in ones, and a look at a file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from olp.exceptions import UsageError
from olp.files.fields import Positive, Text
from olp.files.problems import nearest, validate
from olp.files.schema_base import Table
from olp.files.toml_text import read_toml, toml_lines
from olp.files.write import PathLike, read_bytes

MM = {"mm": 1.0, "um": 1e-3, "m": 1e3, "inch": 25.4}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}
COLUMNS = ("X", "Y", "Z", "t", "name", "line")

Column = Text | Annotated[int, Field(ge=1)]


class ColumnsTable(Table):
    X: Column = Field(default="X_mm", description="the column of X: its name, or its number from 1")
    Y: Column = Field(default="Y_mm", description="the column of Y: its name, or its number from 1")
    Z: Column = Field(default="Z_mm", description="the column of Z: its name, or its number from 1")
    t: Column | None = Field(default=None, description="the column of time: its name, or its number from 1")
    name: Column | None = Field(
        default=None, description="the column of point names: its name, or its number from 1"
    )
    line: Column | None = Field(
        default=None, description="the column of program lines: its name, or its number from 1"
    )

    @property
    def given(self) -> dict[str, str | int]:
        """Column by what it holds, without those that the file has not."""
        return {key: value for key in COLUMNS if (value := getattr(self, key)) is not None}


class PointProfile(Table):
    """olp-points-1: the layout of files of measured points."""

    schema_: Literal["olp-points-1"] = Field(
        alias="schema", default="olp-points-1", description='the format, "olp-points-1"'
    )
    delimiter: Literal["comma", "semicolon", "tab", "space"] = Field(
        default="comma", description='"comma", "semicolon", "tab" or "space" (any blanks) between columns'
    )
    decimal: Literal["point", "comma"] = Field(
        default="point", description='"point" or "comma" as decimal mark'
    )
    unit: Literal["mm", "um", "m", "inch"] = Field(default="mm", description="the unit of X, Y and Z")
    time_unit: Literal["s", "ms", "us"] = Field(default="s", description="the unit of time")
    sample_period_s: Positive | None = Field(
        default=None, description="seconds from point to point, where points come without time"
    )
    header: bool = Field(default=True, description="whether the first row names the columns")
    comment: Text = Field(default="#", description="what lines begin with that hold no point")
    positions: Literal["tip", "axes"] = Field(
        default="tip",
        description='"tip" (where the tool or reflector is) or "axes" (axis positions, from a log of the '
        "control)",
    )
    frame: Text | None = Field(
        default=None,
        description='the frame that the points are stated in, such as "G54"; not known if left out',
    )
    columns: ColumnsTable = Field(default_factory=ColumnsTable, description="the table [columns]")

    def to_toml(self) -> str:
        """The text of a profile file."""
        values = self.model_dump(by_alias=True, exclude_none=True)
        columns = values.pop("columns")
        return "\n".join((*toml_lines(values), "", "[columns]", *toml_lines(columns))) + "\n"


BUILT_IN = {
    "olp": PointProfile(),
    "spatial-analyzer": PointProfile(
        header=False, comment="//", columns=ColumnsTable(X=2, Y=3, Z=4, name=1)
    ),
    "linuxcnc-sampler": PointProfile(
        header=False, delimiter="space", comment="overrun", positions="axes",
        columns=ColumnsTable(X=2, Y=3, Z=4),
    ),
}  # fmt: skip

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_COMMA_NUMBER = re.compile(r"[-+]?\d+,\d+")
_AXIS = r"{}(?:[ _]*[\[(]?(mm|um|m|inch)[\])]?)?"


def load_profile(name: PathLike) -> PointProfile:
    """A built-in profile by its name, or the profile in a TOML file. Raises InputError."""
    if str(name) in BUILT_IN:
        return BUILT_IN[str(name)]
    values, lines = read_toml(read_bytes(name), str(name))
    return validate(PointProfile, values, lines, str(name))


def with_options(profile: PointProfile, columns: Sequence[str], **values: str | float | None) -> PointProfile:
    """A profile with what the command line says: `columns` such as "X=East", and keys that are not None."""
    table = dict(profile.columns.given)
    for item in columns:
        key, mark, column = item.partition("=")
        if not mark or not column or key not in COLUMNS:
            near = nearest(key, COLUMNS)
            hint = f"did you mean {near}?" if near else f"expected one of {', '.join(COLUMNS)}"
            raise UsageError(f"--column {item} is not understood; {hint}, as in --column X=East")
        number = int(column) if column.isdecimal() else None
        if number == 0:
            raise UsageError(f"--column {item}: columns count from 1")
        if not column.strip():
            raise UsageError(f"--column {item} names no column; give its name, or its number from 1")
        table[key] = column if number is None else number
    changed: dict[str, Any] = {key: value for key, value in values.items() if value is not None}
    changed["columns"] = ColumnsTable(**table)
    return profile.model_copy(update=changed)


def looked_at(lines: Sequence[str]) -> PointProfile | None:
    """The profile that the first rows of a file suggest, None where they leave a choice.

    A header that names X, Y and Z, with or without their unit; names and three numbers, as SpatialAnalyzer
    writes them; or three numbers and nothing else.
    """
    comment = "//" if any(line.lstrip().startswith("//") for line in lines) else "#"
    rows = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith(("#", "//"))]
    if not rows:
        return None
    delimiter = _delimiter(rows)
    cells = [_cells(row, delimiter) for row in rows]
    decimal = "comma" if any(_COMMA_NUMBER.fullmatch(c) for row in cells for c in row) else "point"
    common: dict[str, Any] = {"delimiter": delimiter, "decimal": decimal, "comment": comment}
    found = _named(cells[0])
    if found is not None:
        columns, unit = found
        return PointProfile(**common, unit=unit, columns=columns)
    number = [bool(_NUMBER.fullmatch(c.replace(",", "."))) for c in cells[0]]
    if number == [True] * 3:
        return PointProfile(**common, header=False, columns=ColumnsTable(X=1, Y=2, Z=3))
    text = next((i for i, is_number in enumerate(number) if is_number), 0)
    # a point may be named by a number: what counts are three numbers at the end behind a word
    if text and all(number[text:]) and len(number) - 3 in (text, text + 1):
        x = len(number) - 2
        columns = ColumnsTable(X=x, Y=x + 1, Z=x + 2, name=x - 1)
        return PointProfile(**common, header=False, columns=columns)
    return None


def _delimiter(rows: Sequence[str]) -> str:
    row = rows[-1]
    for name, mark in (("semicolon", ";"), ("tab", "\t")):
        if mark in row:
            return name
    decimal_commas = sum(bool(_COMMA_NUMBER.fullmatch(cell)) for cell in row.split())
    return "comma" if "," in row and decimal_commas < 3 else "space"


def _cells(row: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in row.split(DELIMITERS[delimiter])]


def _named(header: Sequence[str]) -> tuple[ColumnsTable, Any] | None:
    """Columns whose names say what they hold, and the unit in them."""
    found: dict[str, str] = {}
    units = set()
    for axis in "XYZ":
        for cell in header:
            match = re.fullmatch(_AXIS.format(axis), cell, re.IGNORECASE)
            if match and axis not in found:
                found[axis] = cell
                units.add((match[1] or "mm").lower())
    if len(found) < 3 or len(units) != 1:
        return None
    others = {"t": ("t_s", "t", "time_s", "time"), "name": ("name", "point"), "line": ("line",)}
    for key, names in others.items():
        match_ = next((cell for cell in header if cell.lower() in names), None)
        if match_ is not None:
            found[key] = match_
    return ColumnsTable(**found), units.pop()
