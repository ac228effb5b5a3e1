"""Points and lengths for a calibration: commanded axis positions, and what an instrument read there.

    # tool_mm = [0.0, 0.0, -120.0]
    X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm
    100,200,-300,5321.4021,887.1120,-411.9034

The instrument frame is unknown. Columns tool_X_mm, tool_Y_mm, tool_Z_mm hold the vector from the gauge point
to the reflector where it differs from point to point. Other instruments have other columns instead of the
measured ones. Lengths from a station: length_mm. A polar station: distance_mm, azimuth_deg and elevation_deg.
Directions from pods: azimuth_1_deg, elevation_1_deg, azimuth_2_deg ...

Columns may be in inches, m, gon or rad: X_inch, measured_X_m, azimuth_1_gon. Angles in columns such as
azimuth_1_dms are degrees, minutes and seconds: 95 20 24.9, 95-20-24.9 or with their signs. Semicolons or tabs
may separate columns, with a comma or a point in numbers.

Measured positions may have uncertainties of their own, in the frame of their coordinates: sigma_X_um,
sigma_Y_um, sigma_Z_um, or covariance_XX_um2, covariance_XY_um2, covariance_XZ_um2, covariance_YY_um2 ...
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Mask
from olp.core.errors import ConfigError
from olp.core.schema import Table
from olp.core.schema_keys import Field
from olp.core.units import AXES, MM_PER_UM
from olp.core.values import dataclass
from olp.files.columns import Wanted, decoded, finite, missing, names, read_sheet, unknown
from olp.files.measurements.stated import stated_keys
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes
from olp.program.text.rows import CSV, Form

AXIS = tuple(f"{axis}_mm" for axis in AXES)
MEASURED = tuple(f"measured_{axis}_mm" for axis in AXES)
LENGTH = ("length_mm",)
POLAR = ("distance_mm", "azimuth_deg", "elevation_deg")
#: Actual minus commanded, instead of measured positions.
DEVIATION = tuple(f"deviation_{axis}_um" for axis in AXES)
TOOL = tuple(f"tool_{axis}_mm" for axis in AXES)
#: The standard uncertainty of each coordinate of a point, or the covariance of all three.
SIGMA = tuple(f"sigma_{axis}_um" for axis in AXES)
COVARIANCE = tuple(
    f"covariance_{first}{second}_um2" for first, second in itertools.combinations_with_replacement(AXES, 2)
)


#: No instrument knows a coordinate better than this, um.
_LEAST_UM = 0.01

#: Units that columns may have instead: the ends of their names, and the factor between both.
_UNITS = (
    ("_inch", "_mm", 25.4),
    ("_m", "_mm", 1e3),
    ("_gon", "_deg", 0.9),
    ("_dms", "_deg", 1.0),
    ("_rad", "_deg", 180.0 / math.pi),
)


#: Degrees, minutes and seconds, with anything between them that instruments write there.
_DMS = re.compile(r"([-+]?)(\d{1,3})[°d: -]+(\d{1,2})['\u2032m: -]+(\d{1,2}(?:\.\d*)?)[\"\u2033s' ]*")


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
    """Azimuths counter-clockwise and elevations in rad, from angles in rad as the instrument counts them. A
    zenith angle above half a turn was read in the second face, as if the telescope looked backward."""
    up = 0.5 * math.pi - vertical if angles.vertical == "zenith" else vertical
    second = in_second_face(angles, vertical)
    up = np.where(second, -math.pi - up, up)
    return np.asarray(AZIMUTHS[angles.azimuth] * azimuth + math.pi * second), np.asarray(up)


def in_second_face(angles: AngleKeys, vertical: Array) -> Mask:
    """Which vertical angles in rad were read in the second face of a theodolite."""
    return np.asarray((angles.vertical == "zenith") & (vertical > math.pi) & (vertical < 2.0 * math.pi))


@dataclass(frozen=True, slots=True, eq=False)
class PointReadings:
    """(n, 3) columns in mm, and `measured` (n, k) as in the file. `tool_mm` is None where the file has no
    such columns, nor `covariance_mm2` (n, 3, 3). `row` (n,) is the line of each point. `keys` are the
    comments, each with its line."""

    file: str
    axis_mm: Array
    measured: Array
    tool_mm: Array | None
    row: npt.NDArray[np.int64]
    keys: Mapping[str, tuple[str, int]]
    covariance_mm2: Array | None = None

    @property
    def sigma_mm(self) -> float | None:
        """Root mean square of the standard uncertainties of coordinates, where points have their own."""
        if self.covariance_mm2 is None:
            return None
        return float(np.sqrt(np.trace(self.covariance_mm2, axis1=1, axis2=2).mean() / 3.0))


def read_point_readings(path: PathLike, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """The points of a file, or its lengths (`measured` = LENGTH). Raises InputError where the file cannot be
    read, ConfigError with every problem."""
    return parse_point_readings(read_bytes(path), str(path), measured)


def parse_point_readings(data: bytes, file: str, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """As `read_point_readings`, from the bytes of the file."""
    spreads = (SIGMA, COVARIANCE) if measured == MEASURED else ()
    form, number = _form_of(decoded(data, file), file)
    known = (*AXIS, *measured, *TOOL, *(name for group in spreads for name in group))

    def header_problems(line: int, written: Sequence[str]) -> list[Problem]:
        header = [_own_unit(name)[0] for name in written]
        some = [group for group in (TOOL, *spreads) if any(name in header for name in group)]
        wanted = (*AXIS, *measured, *(name for group in some for name in group))
        return [
            *names(line, header, lambda _, name: unknown(name, known)),
            *missing(line, header, wanted),
        ]

    nothing = f"holds no points; expected {','.join((*AXIS, *measured))}"
    sheet = read_sheet(data, file, Wanted(nothing, header_problems, number, form=form))
    if sheet.problems:
        raise config_error(sheet.problems, file)
    header, factors = zip(*(_own_unit(name) for name in sheet.header), strict=True)
    table = sheet.table * np.array(factors)

    def columns(group: Sequence[str]) -> Array:
        return np.asarray(table[:, [header.index(name) for name in group]])

    spread = [group for group in spreads if group[0] in header]
    if len(spread) > 1:
        raise ConfigError(
            f"has columns {SIGMA[0]} and {COVARIANCE[0]}; expected one of both kinds", file=file
        )
    covariance = covariances(columns(spread[0]), sheet.lines, file) if spread else None
    return PointReadings(
        file,
        columns(AXIS),
        columns(measured),
        columns(TOOL) if TOOL[0] in header else None,
        sheet.lines,
        dict(stated_keys(sheet.text)),
        covariance,
    )


def covariances(values: Array, lines: npt.NDArray[np.int64], file: str) -> Array:
    """(n, 3, 3) in mm^2 from standard uncertainties (n, 3) in um or covariances (n, 6) in um^2. Raises
    ConfigError where one of them is no covariance."""
    matrix = np.zeros((len(values), 3, 3))
    if values.shape[1] == len(SIGMA):
        matrix[:, range(3), range(3)] = values * np.abs(values)
    else:
        first, second = np.triu_indices(3)
        matrix[:, first, second] = matrix[:, second, first] = values
    wrong = np.flatnonzero(np.linalg.eigvalsh(matrix)[:, 0] <= 0.0)
    if len(wrong):
        raise config_error(
            [
                (int(lines[k]), "the covariance of the point is not positive; expected variances above 0")
                for k in wrong[:8]
            ],
            file,
        )
    least = float(np.sqrt(np.trace(matrix, axis1=1, axis2=2).min() / 3.0))
    if least < _LEAST_UM:
        raise ConfigError(
            f"states an uncertainty of {least:.2g} um of a coordinate, which no instrument reaches; expected "
            "columns in um or um^2, not in mm or mm^2",
            file=file,
        )
    return matrix * MM_PER_UM**2


def header_in(text: str) -> tuple[str, ...]:
    """The names of the columns of a text, in the units that tables here have."""
    form = _form_of(text, "")[0]
    first = next((line for _, line in form.lines(text) if form.holds(line)), "")
    return tuple(_own_unit(cell)[0] for cell in form.cells(first))


def _own_unit(name: str) -> tuple[str, float]:
    """The name of a column in the unit that tables here have, and the factor to it."""
    for ending, own, factor in _UNITS:
        if name.endswith(ending):
            return name.removesuffix(ending) + own, factor
    return name, 1.0


def _form_of(text: str, file: str) -> tuple[Form, Callable[[str, str], tuple[float, str | None]]]:
    """How a text separates its columns, and how it writes numbers. Raises ConfigError where that is not
    certain: numbers with commas beside numbers with points."""
    data = [line for _, line in CSV.lines(text) if CSV.holds(line)]
    mark = next((mark for mark in ";\t" if data and mark in data[0]), None)
    if mark is None:
        return CSV, _number
    values = "".join(data[1:])
    if "," in values and "." in values:
        raise ConfigError("has numbers with commas and with points; expected one of them", file=file)
    return Form(mark), lambda name, cell: _number(name, cell.replace(",", "."))


def _number(name: str, cell: str) -> tuple[float, str | None]:
    value = _of_dms(cell) if name.endswith("_dms") else finite(cell)
    what = "degrees, minutes and seconds" if name.endswith("_dms") else name.rpartition("_")[2]
    wrong = f'{name} = "{cell}"; expected a number in {what}'
    return value, wrong if math.isnan(value) else None


def _of_dms(cell: str) -> float:
    """Degrees from degrees, minutes and seconds; NaN for anything else."""
    match = _DMS.fullmatch(cell.strip())
    if match is None or int(match[3]) > 59 or float(match[4]) >= 60.0:
        return math.nan
    return (-1.0 if match[1] == "-" else 1.0) * (int(match[2]) + int(match[3]) / 60 + float(match[4]) / 3600)
