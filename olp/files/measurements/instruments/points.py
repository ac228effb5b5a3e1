"""Points of a tracker or any instrument of coordinates: tables [[points]]."""

from __future__ import annotations

from typing import Literal

from olp.calibration.observations.points import Points
from olp.core.arrays import Index
from olp.core.errors import ConfigError
from olp.core.schema import NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM, UM_PER_MM
from olp.files.measurements.instruments.base import PER_UNIT, Instrument, Plan, points_to_fill, tools_of
from olp.files.measurements.point_readings import MEASURED, read_point_readings
from olp.files.toml_text import toml_lines


class PointsTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns X_mm, Y_mm, Z_mm (axis positions) and "
        "measured_X_mm, measured_Y_mm, measured_Z_mm (in the instrument's frame), relative to this file"
    )
    sigma_um: Positive | None = Field(
        default=None,
        description="the standard uncertainty of a coordinate, in um; or columns sigma_X_um ... of the file, "
        "or covariance_XX_um2, covariance_XY_um2 ... of each point",
    )
    frame: Literal["unknown", "known"] = Field(
        default="unknown",
        description='"unknown" (of the instrument), or "known": measured_ columns are in the frame of the '
        "machine, as TCP points against a simulation model are",
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the vector from the gauge point to the reflector, [X, Y, Z] in mm; or columns "
        "tool_X_mm, tool_Y_mm, tool_Z_mm of the file",
    )
    sigma_scale_um_m: NotNegative = Field(
        default=0.0, description="the standard uncertainty of the instrument's scale, in um/m"
    )


class PointFiles(Instrument[PointsTable, Points]):
    key = "points"
    table = PointsTable
    marks = MEASURED
    asks = ("sigma_um", "tool_mm")
    words = "tables [[points]]: one set-up of a tracker each"
    gives = Points
    plans = True

    def read(self, table: PointsTable, plan: Plan) -> Points:
        readings = read_point_readings(plan.beside(table.file))
        own = readings.sigma_mm
        if (own is None) == (table.sigma_um is None):
            wrong = "is missing" if own is None else "is stated here and in columns of the file"
            raise ConfigError(f"sigma_um {wrong}; expected the uncertainty of the points once")
        return Points(
            axis_mm=readings.axis_mm,
            tool_mm=tools_of(readings, table.tool_mm, plan.defaults),
            measured_mm=readings.measured,
            sigma=own or (table.sigma_um or 0.0) * MM_PER_UM,
            sigma_scale=table.sigma_scale_um_m * PER_UNIT,
            source=readings.file,
            row=readings.row,
            known_frame=table.frame == "known",
            covariance_mm2=readings.covariance_mm2,
        )

    def asked(self, taken: Points, name: str) -> list[str]:
        return ["[[points]]", *toml_lines({"file": name, "sigma_um": round(taken.sigma * UM_PER_MM, 6)})]

    def empty(self, taken: Points, rows: Index) -> bytes:
        return points_to_fill(taken, rows, MEASURED)
