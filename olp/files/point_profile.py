"""The layout of files of measured points: profiles as TOML files, built-in profiles, and detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

from olp.core.errors import UsageError
from olp.core.schema import NotNegative, Positive, Table, Text, copied, stated_values
from olp.core.schema_keys import Field
from olp.files.fields import nearest
from olp.files.problems import validate
from olp.files.toml_text import read_toml, toml_lines
from olp.files.write import PathLike, Reader, read_bytes
from olp.program.text.delimited import ROLES, Layout, detected_layout, mapping

#: The columns of measured points that are compared.
MEASURED = ("X", "Y", "Z", "t", "name", "line")

#: Keys that a profile and a layout share.
_SAME = (
    "delimiter", "decimal", "time_unit", "speed_unit", "header", "comment", "frame", "point", "tip_radius_mm",
    "approach_mm", "joined", "insert", "stamp",
)  # fmt: skip

Column = Text | Annotated[int, Field(ge=1)]


def _column(what: str) -> Any:
    return Field(default=None, description=f"the column of {what}: its name, or its number from 1")


class ColumnsTable(Table):
    X: Column = Field(default="X_mm", description="the column of X: its name, or its number from 1")
    Y: Column = Field(default="Y_mm", description="the column of Y: its name, or its number from 1")
    Z: Column = Field(default="Z_mm", description="the column of Z: its name, or its number from 1")
    t: Column | None = _column("time")
    name: Column | None = _column("point names")
    line: Column | None = _column("program lines")
    A: Column | None = _column("the first angle of orientation")
    B: Column | None = _column("the second angle of orientation")
    C: Column | None = _column("the third angle of orientation")
    I: Column | None = _column("X of the direction out of the surface")  # noqa: E741
    J: Column | None = _column("Y of the direction out of the surface")
    K: Column | None = _column("Z of the direction out of the surface")
    speed: Column | None = _column("speed")
    blend: Column | None = _column("blending")
    tool: Column | None = _column("tool numbers")
    SX: Column | None = _column("X of the stylus, gauge point to tip, in the unit of X")
    SY: Column | None = _column("Y of the stylus, gauge point to tip, in the unit of Y")
    SZ: Column | None = _column("Z of the stylus, gauge point to tip, in the unit of Z")

    @property
    def given(self) -> dict[str, str | int]:
        """Columns by what they hold, only those that the file has."""
        return {key: value for key in ROLES if (value := getattr(self, key)) is not None}


class PointProfile(Table):
    """olp-points-1: the layout of tables of points, measured ones and those of a program."""

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
    speed_unit: Literal["mm/s", "mm/min", "m/s", "m/min", "inch/min"] | None = Field(
        default=None, description="the unit of speed; unknown if left out"
    )
    sample_period_s: Positive | None = Field(
        default=None, description="seconds from point to point, where points have no time"
    )
    header: bool = Field(default=True, description="whether the first row names the columns")
    comment: Text = Field(default="#", description="the mark at the beginning of lines that hold no point")
    positions: Literal["tip", "axes"] = Field(
        default="tip",
        description='"tip" (of the tool or reflector) or "axes" (axis positions, from a log of the control)',
    )
    frame: Text | None = Field(
        default=None,
        description='the frame of the points, such as "G54"; unknown if left out',
    )
    point: Literal["surface", "centre"] | None = Field(
        default=None,
        description='what a measured point states: "surface" or "centre" (of the tip); unknown if left out',
    )
    tip_radius_mm: NotNegative | None = Field(
        default=None, description="the radius of the tip, in mm; the tool's if left out"
    )
    approach_mm: NotNegative | None = Field(
        default=None,
        description="the distance of the approach to the surface before a touch, in mm; unknown if left out",
    )
    joined: Literal["points", "lines"] = Field(
        default="points",
        description='how the machine moves from row to row of a program: "points" (unknown) or "lines" '
        "(straight)",
    )
    insert: bool = Field(
        default=False, description="whether rows may be inserted where errors would bend a straight line"
    )
    stamp: bool = Field(
        default=True,
        description="whether a corrected table may begin with a comment that marks it as corrected",
    )
    columns: ColumnsTable = Field(default_factory=ColumnsTable, description="the table [columns]")

    @property
    def layout(self) -> Layout:
        """The same as a value."""
        return Layout(
            columns=mapping(self.columns.given),
            unit=self.unit,
            **{key: getattr(self, key) for key in _SAME},
        )

    def to_toml(self) -> str:
        """The text of a profile file."""
        values = stated_values(self)
        columns = stated_values(values.pop("columns"))
        return "\n".join((*toml_lines(values), "", "[columns]", *toml_lines(columns))) + "\n"


#: Profiles by name.
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


def load_profile(name: PathLike, read: Reader = read_bytes) -> PointProfile:
    """A built-in profile by its name, or the profile in a TOML file. Raises InputError."""
    if str(name) in BUILT_IN:
        return BUILT_IN[str(name)]
    values, lines = read_toml(read(name), str(name))
    return validate(PointProfile, values, lines, str(name))


def with_options(profile: PointProfile, columns: Sequence[str], **values: str | float | None) -> PointProfile:
    """A profile with options of the command line: `columns` such as "X=East", and keys that are not None."""
    table = dict(profile.columns.given)
    for item in columns:
        key, mark, column = item.partition("=")
        if not mark or not column or key not in ROLES:
            near = nearest(key, ROLES)
            hint = f"did you mean {near}?" if near else f"expected one of {', '.join(ROLES)}"
            raise UsageError(f"--column {item} is not understood; {hint}, as in --column X=East")
        number = int(column) if column.isdecimal() else None
        if number == 0:
            raise UsageError(f"--column {item}: columns count from 1")
        if not column.strip():
            raise UsageError(f"--column {item} names no column; give its name, or its number from 1")
        table[key] = column if number is None else number
    changed: dict[str, Any] = {key: value for key, value in values.items() if value is not None}
    changed["columns"] = ColumnsTable(**table)
    return copied(profile, **changed)


def looked_at(lines: Sequence[str]) -> PointProfile | None:
    """The profile of measured points detected from the first rows of a file, in mm where they state no unit.
    None where it is ambiguous."""
    layout = detected_layout(lines)
    if layout is None:
        return None
    columns = {role: column for role, column in layout.columns.items() if role in MEASURED}
    return from_layout(replace(layout, columns=columns))


def from_layout(layout: Layout) -> PointProfile:
    """The profile of a layout, in mm where it states no unit."""
    values = {key: getattr(layout, key) for key in _SAME} | {
        "unit": layout.unit or "mm", "columns": ColumnsTable(**dict[str, Any](layout.columns)),
    }  # fmt: skip
    return PointProfile(**values)
