"""Points and lengths for a calibration: where the axes were commanded, and what an instrument saw there.

    # tool_mm = [0.0, 0.0, -120.0]
    X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm
    100,200,-300,5321.4021,887.1120,-411.9034

The instrument's frame is its own. Columns tool_X_mm, tool_Y_mm, tool_Z_mm hold the vector from the gauge
point to the reflector where it differs from point to point. Lengths from a station have one column length_mm
in place of the measured ones, a polar station distance_mm, azimuth_deg and elevation_deg, directions from
pods azimuth_1_deg, elevation_1_deg, azimuth_2_deg ...
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.units import AXES
from olp.files.measurements.readings import stated_keys
from olp.files.problems import Problem, config_error, nearest
from olp.files.tables import decoded
from olp.files.write import PathLike, read_bytes

AXIS = tuple(f"{axis}_mm" for axis in AXES)
MEASURED = tuple(f"measured_{axis}_mm" for axis in AXES)
LENGTH = ("length_mm",)
POLAR = ("distance_mm", "azimuth_deg", "elevation_deg")
#: Actual minus commanded, in place of measured places.
DEVIATION = tuple(f"deviation_{axis}_um" for axis in AXES)
TOOL = tuple(f"tool_{axis}_mm" for axis in AXES)


def directions(pods: int) -> tuple[str, ...]:
    """The columns of angles of so many pods."""
    return tuple(f"{angle}_{k + 1}_deg" for k in range(pods) for angle in ("azimuth", "elevation"))


@dataclass(frozen=True, slots=True, eq=False)
class PointReadings:
    """(n, 3) columns in mm, `measured` (n, k) as in the file; `tool_mm` is None where the file has no such
    columns. `row` (n,) is the line of each point, `keys` what the file states in comments, each with its
    line."""

    file: str
    axis_mm: Array
    measured: Array
    tool_mm: Array | None
    row: npt.NDArray[np.int64]
    keys: Mapping[str, tuple[str, int]]


def read_point_readings(path: PathLike, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """The points of a file, or its lengths (`measured` = LENGTH). Raises InputError where it cannot be read,
    ConfigError with every problem."""
    return parse_point_readings(read_bytes(path), str(path), measured)


def parse_point_readings(data: bytes, file: str, measured: tuple[str, ...] = MEASURED) -> PointReadings:
    """As `read_point_readings`, from the bytes of the file."""
    text = decoded(data, file)
    records = [
        (number, [cell.strip() for cell in next(csv.reader(io.StringIO(line)))])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not records:
        raise config_error([(None, f"holds no points; expected {','.join((*AXIS, *measured))}")], file)
    line, header = records[0]
    found: list[Problem] = [(line, sentence) for sentence in _header_problems(header, measured)]
    if found:
        raise config_error(found, file)
    rows = []
    for number, cells in records[1:]:
        if len(cells) != len(header):
            found.append((number, f"{len(cells)} values under {len(header)} columns"))
            continue
        values = [_number(cell) for cell in cells]
        for name, cell, value in zip(header, cells, values, strict=True):
            if not math.isfinite(value):
                found.append((number, f'{name} = "{cell}"; expected a number in {name.rpartition("_")[2]}'))
        rows.append(values)
    if found:
        raise config_error(found, file)
    table = np.array(rows, float).reshape(-1, len(header))

    def columns(names: Sequence[str]) -> Array:
        return np.asarray(table[:, [header.index(name) for name in names]])

    return PointReadings(
        file,
        columns(AXIS),
        columns(measured),
        columns(TOOL) if TOOL[0] in header else None,
        np.array([number for number, _ in records[1:]], np.int64),
        dict(stated_keys(text)),
    )


def _header_problems(header: Sequence[str], measured: tuple[str, ...]) -> Iterator[str]:
    known = (*AXIS, *measured, *TOOL)
    for number, name in enumerate(header, 1):
        if header.index(name) < number - 1:
            yield f'column {number} repeats "{name}"; expected each column once'
        elif name not in known:
            near = nearest(name, known)
            yield f'column {number} is "{name}"; ' + (
                f"did you mean {near}?" if near else f"expected one of {', '.join(known)}"
            )
    wanted = (*AXIS, *measured, *(TOOL if any(name in header for name in TOOL) else ()))
    yield from (f"the column {name} is missing" for name in wanted if name not in header)


def _number(cell: str) -> float:
    try:
        return float(cell) if "_" not in cell else math.nan
    except ValueError:
        return math.nan
