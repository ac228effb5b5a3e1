"""Files of circles of a ball-bar: tables [[ballbars]]."""

from __future__ import annotations

from typing import Literal

import numpy as np

from olp.calibration.observations.circles import Circles
from olp.core.schema import NotNegative, Positive, Table, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.measurements.columns import read_columns
from olp.files.measurements.instruments.base import Instrument, Plan
from olp.files.measurements.instruments.self_described import InstrumentTable
from olp.files.write import PathLike


class CircleKeys(Table):
    """What a file of a ball-bar states about itself."""

    plane: Literal["XY", "YZ", "ZX"] = Field(description="the plane, first axis first: XY, YZ or ZX")
    radius_mm: Positive = Field(description="the nominal radius in mm")
    centre_mm: Triple = Field(description="the axis positions of the centre, [X, Y, Z] in mm")
    tool_mm: Triple = Field(description="the vector from the gauge point to the ball, [X, Y, Z] in mm")
    feed_mm_s: NotNegative = Field(default=0.0, description="the feed along the circle in mm/s")
    sigma_um: NotNegative = Field(default=0.0, description="the standard uncertainty of one reading in um")
    sense: Literal["longer-is-positive", "shorter-is-positive"] = Field(
        default="longer-is-positive", description='"longer-is-positive" (a larger radius) or the opposite'
    )


def read_circles(path: PathLike) -> Circles:
    """Read columns `angle_deg,run,direction,deviation_um`. The angle counts from the first axis of the plane
    toward the second. Direction is 1 that way (counter-clockwise), else -1.

    Raises InputError, ConfigError.
    """
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


class BallbarFiles(Instrument[InstrumentTable, Circles]):
    key = "ballbars"
    table = InstrumentTable
    marks = ("angle_deg",)
    words = "tables [[ballbars]]: the circles of a ball-bar about one centre each"
    gives = Circles

    def read(self, table: InstrumentTable, plan: Plan) -> Circles:
        return read_circles(plan.beside(table.file))
