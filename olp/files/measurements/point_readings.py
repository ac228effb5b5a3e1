"""Points and lengths for a calibration: commanded axis positions, and what an instrument read there.

    # tool_mm = [0.0, 0.0, -120.0]
    X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm
    100,200,-300,5321.4021,887.1120,-411.9034

The instrument frame is unknown. Columns tool_X_mm, tool_Y_mm, tool_Z_mm hold the vector from the gauge point
to the reflector where it differs from point to point. Other instruments have other columns instead of the
measured ones. Lengths from a station: length_mm. A polar station: distance_mm, azimuth_deg and elevation_deg.
Directions from pods: azimuth_1_deg, elevation_1_deg, azimuth_2_deg ...
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.schema import Table
from olp.core.schema_keys import Field
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.files.columns import Wanted, finite, missing, names, read_sheet, unknown
from olp.files.measurements.stated import stated_keys
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes

AXIS = tuple(f"{axis}_mm" for axis in AXES)
MEASURED = tuple(f"measured_{axis}_mm" for axis in AXES)
LENGTH = ("length_mm",)
POLAR = ("distance_mm", "azimuth_deg", "elevation_deg")
#: Actual minus commanded, instead of measured positions.
DEVIATION = tuple(f"deviation_{axis}_um" for axis in AXES)
TOOL = tuple(f"tool_{axis}_mm" for axis in AXES)


def directions(pods: int) -> tuple[str, ...]:
    """The columns of angles of a number of pods."""
    return tuple(f"{angle}_{k + 1}_deg" for k in range(pods) for angle in ("azimuth", "elevation"))


#: How an instrument counts its azimuths, seen from above, each with its factor.
AZIMUTHS: Mapping[str, float] = MappingProxyType({"counter-clockwise": 1.0, "clockwise": -1.0})


class AngleKeys(Table):
    """How the angles of an instrument count. Every table of directions has these keys."""

    azimuth: Literal["counter-clockwise", "clockwise"] = Field(
        default="counter-clockwise",
        description="how azimuths count, seen from above; most theodolites count clockwise",
    )
    vertical: Literal["elevation", "zenith"] = Field(
        default="elevation",
        description='what the column of elevations holds: "elevation" from the horizontal, + up, or "zenith" '
        "from straight up",
    )


def conventional(angles: AngleKeys, azimuth: Array, vertical: Array) -> tuple[Array, Array]:
    """Azimuths counter-clockwise and elevations in rad, from angles in rad as the instrument counts them."""
    up = 0.5 * math.pi - vertical if angles.vertical == "zenith" else vertical
    return np.asarray(AZIMUTHS[angles.azimuth] * azimuth), np.asarray(up)


@dataclass(frozen=True, slots=True, eq=False)
class PointReadings:
    """(n, 3) columns in mm, and `measured` (n, k) as in the file. `tool_mm` is None where the file has no
    such columns. `row` (n,) is the line of each point. `keys` are the comments, each with its line."""

    file: str
    axis_mm: Array
    measured: Array
    tool_mm: Array | None
    row: npt.NDArray[np.int64]
    keys: Mapping[str, tuple[str, int]]


def read_point_readings(path: PathLike, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """The points of a file, or its lengths (`measured` = LENGTH). Raises InputError where the file cannot be
    read, ConfigError with every problem."""
    return parse_point_readings(read_bytes(path), str(path), measured)


def parse_point_readings(data: bytes, file: str, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """As `read_point_readings`, from the bytes of the file."""
    known = (*AXIS, *measured, *TOOL)

    def header_problems(line: int, header: Sequence[str]) -> list[Problem]:
        wanted = (*AXIS, *measured, *(TOOL if any(name in header for name in TOOL) else ()))
        return [
            *names(line, header, lambda _, name: unknown(name, known)),
            *missing(line, header, wanted),
        ]

    nothing = f"holds no points; expected {','.join((*AXIS, *measured))}"
    sheet = read_sheet(data, file, Wanted(nothing, header_problems, _number))
    if sheet.problems:
        raise config_error(sheet.problems, file)
    table = sheet.table

    def columns(group: Sequence[str]) -> Array:
        return np.asarray(table[:, [sheet.header.index(name) for name in group]])

    return PointReadings(
        file,
        columns(AXIS),
        columns(measured),
        columns(TOOL) if TOOL[0] in sheet.header else None,
        sheet.lines,
        dict(stated_keys(sheet.text)),
    )


def _number(name: str, cell: str) -> tuple[float, str | None]:
    value = finite(cell)
    wrong = f'{name} = "{cell}"; expected a number in {name.rpartition("_")[2]}'
    return value, wrong if math.isnan(value) else None
