"""Files of ball-bars, of lasers along diagonals, and of postures: CSV with comments `# key = value`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field

from olp.calibration.iso230.postures import Postures, turn_of
from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.core.errors import ConfigError
from olp.core.machine import Tool
from olp.core.units import MM_PER_UM
from olp.files.fields import NotNegative, Positive, Text, Triple
from olp.files.measurements.columns import read_columns
from olp.files.measurements.readings import SENSES
from olp.files.measurements.schemas import Sense
from olp.files.problems import config_error
from olp.files.schema_base import Table
from olp.files.write import PathLike

PER_UNIT = 1e-6


class CircleKeys(Table):
    """What a file of a ball-bar says about itself."""

    plane: Literal["XY", "YZ", "ZX"] = Field(description="the plane, first axis first: XY, YZ or ZX")
    radius_mm: Positive = Field(description="the nominal radius in mm")
    centre_mm: Triple = Field(description="the axis positions of the centre, [X, Y, Z] in mm")
    tool_mm: Triple = Field(description="the vector from the gauge point to the ball, [X, Y, Z] in mm")
    feed_mm_s: NotNegative = Field(default=0.0, description="the feed along the circle in mm/s")
    sigma_um: NotNegative = Field(default=0.0, description="the standard uncertainty of one reading in um")
    sense: Literal["longer-is-positive", "shorter-is-positive"] = Field(
        default="longer-is-positive", description='"longer-is-positive" (a larger radius) or the opposite'
    )


class DiagonalKeys(Table):
    """What a file of a laser along a diagonal says about itself."""

    start_mm: Triple = Field(description="the axis positions where it starts, [X, Y, Z] in mm")
    end_mm: Triple = Field(description="the axis positions where it ends, [X, Y, Z] in mm")
    tool_mm: Triple = Field(description="the vector from the gauge point to the reflector, [X, Y, Z] in mm")
    sense: Sense = Field(description='"actual-minus-commanded" or "commanded-minus-actual"')
    sigma_um: NotNegative = Field(default=0.0, description="the standard uncertainty of one reading in um")
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the laser's scale in um/m"
    )


class PostureKeys(Table):
    """What a file of postures says about itself."""

    sigma_um: NotNegative = Field(
        default=0.0, description="the standard uncertainty of one coordinate of a posture in um"
    )
    point: Text | None = Field(default=None, description="words on what was touched, kept for the report")


def read_circles(path: PathLike) -> Circles:
    """Columns `angle_deg,run,direction,deviation_um`: the angle from the first axis of the plane toward the
    second, direction 1 in that sense (counter-clockwise) or -1. Raises InputError, ConfigError."""
    columns, keys = read_columns(path, CircleKeys, ("angle_deg", "run", "direction", "deviation_um"))
    sign = 1.0 if keys.sense == "longer-is-positive" else -1.0
    return Circles(
        keys.plane,
        keys.radius_mm,
        keys.centre_mm,
        np.radians(columns.number["angle_deg"]),
        columns.number["deviation_um"] * MM_PER_UM * sign,
        columns.number["run"].astype(np.int64),
        columns.number["direction"].astype(np.int64),
        keys.tool_mm,
        keys.feed_mm_s,
        keys.sigma_um * MM_PER_UM,
        str(path),
    )


def read_diagonal(path: PathLike) -> Diagonal:
    """Columns `target_mm,run,direction,value_um`: the distance from the start, direction 1 away from it.
    Raises InputError, ConfigError."""
    columns, keys = read_columns(path, DiagonalKeys, ("target_mm", "run", "direction", "value_um"))
    return Diagonal(
        keys.start_mm,
        keys.end_mm,
        columns.number["target_mm"],
        columns.number["value_um"] * MM_PER_UM * SENSES[keys.sense],
        columns.number["run"].astype(np.int64),
        columns.number["direction"].astype(np.int64),
        keys.tool_mm,
        keys.sigma_um * MM_PER_UM,
        keys.sigma_scale_um_m * PER_UNIT,
        str(path),
    )


def read_postures(path: PathLike, tools: Mapping[int, Tool] | None = None) -> Postures:
    """Columns `X_mm,Y_mm,Z_mm,tool[,TX_mm,TY_mm,TZ_mm][,A_deg,B_deg,C_deg]`: axis positions, the name of the
    tool, its nominal vector in the frame of the head, and the turn Rz(C) Ry(B) Rx(A) of the head. Without
    TX_mm to TZ_mm, tools are numbers of `tools`. Raises InputError, ConfigError."""
    vector, turn = ("TX_mm", "TY_mm", "TZ_mm"), ("A_deg", "B_deg", "C_deg")
    columns, keys = read_columns(path, PostureKeys, ("X_mm", "Y_mm", "Z_mm"), (*vector, *turn), ("tool",))
    number, n = columns.number, len(columns.line)
    given = [name for name in vector if name in number]
    if given and len(given) < 3:
        raise ConfigError(f"has {', '.join(given)}; expected all of {', '.join(vector)}", file=str(path))
    if given:
        vectors = np.column_stack([number[name] for name in vector])
    else:
        vectors = np.array([
            _vector(name, int(line), tools or {}, str(path))
            for name, line in zip(columns.word["tool"], columns.line, strict=True)
        ])  # fmt: skip
    angles = [number.get(name, np.zeros(n)) for name in turn]
    return Postures(
        np.column_stack([number[name] for name in ("X_mm", "Y_mm", "Z_mm")]),
        columns.word["tool"], vectors, turn_of(angles[0], angles[1], angles[2]),
        keys.sigma_um * MM_PER_UM, str(path),
    )  # fmt: skip


def _vector(name: str, line: int, tools: Mapping[int, Tool], file: str) -> tuple[float, float, float]:
    tool = tools.get(int(name)) if name.isdigit() else None
    if tool is None or tool.lever_mm is None:
        sentence = (
            f"tool {name} has no vector; expected the columns TX_mm, TY_mm, TZ_mm, or a tool number of the "
            "machine file (-m) with gauge_to_tip_mm or a length"
        )
        raise config_error([(line, sentence)], file)
    return tool.lever_mm
